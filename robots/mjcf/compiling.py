"""MuJoCo itself, which knows what the defaults, angles and sizes of an MJCF come to."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from robots.common.errors import AssetError, MissingPackageError
from robots.mjcf.text import MjcfText

Model = Any
"""A ``mujoco.MjModel``, whose package need not be installed."""

MESSAGE = 400  # characters of MuJoCo's own that an error keeps
NUMBERS = {  # MuJoCo takes "nan" for a number
    "a body": ("body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos", "body_iquat"),
    "a joint": ("jnt_pos", "jnt_axis", "jnt_range", "qpos0", "dof_armature", "dof_damping"),
    "a shape": ("geom_pos", "geom_quat", "geom_size"),
    "a site": ("site_pos", "site_quat"),
}


def mujoco() -> Any:
    """Return the package mujoco.

    Raises:
        MissingPackageError: If it is not installed.
    """
    try:
        import mujoco  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingPackageError(
            "reading an MJCF needs MuJoCo: pip install 'robot-layouts[mjcf]'"
        ) from error
    return mujoco


@contextmanager
def without_log() -> Generator[None]:
    """Have MuJoCo write its warnings nowhere; else it adds them to a file where it was started."""
    library = mujoco()
    library.set_mju_user_warning(_ignore)
    try:
        yield
    finally:
        library.set_mju_user_warning(None)


def _ignore(warning: str) -> None:
    """Do nothing about a warning: what is wrong with a model is an error."""


def compiled(text: MjcfText, path: Path) -> Model:
    """Return the model that MuJoCo makes of an MJCF.

    Args:
        text: The MJCF.
        path: Where it lies, for messages.

    Raises:
        AssetError: If MuJoCo refuses it, or a number of it is not finite.
        MissingPackageError: If MuJoCo is not installed.
    """
    library = mujoco()
    try:
        with without_log():
            model = library.MjModel.from_xml_string(text.xml, dict(text.meshes))
    except Exception as error:  # a compiler that raises whatever it meets
        reason = " ".join(str(error).split())[:MESSAGE]
        raise AssetError(f"MuJoCo cannot compile {path}: {reason}") from error
    for what, fields in NUMBERS.items():
        if not all(np.isfinite(getattr(model, field)).all() for field in fields):
            raise AssetError(f"{path} has {what} with a number that is not finite")
    return model


def name_of(model: Model, kind: str, index: int) -> str:
    """Return the name of an object of a model; empty if it has none.

    Args:
        model: The model.
        kind: Such as ``"body"`` or ``"joint"``.
        index: Its index.
    """
    library = mujoco()
    return library.mj_id2name(model, getattr(library.mjtObj, f"mjOBJ_{kind.upper()}"), index) or ""
