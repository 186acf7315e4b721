"""What is drawn of bodies in MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np

from layouts.visuals import load_meshes
from objects.shapes import Mesh, Shape
from robot_layouts.simulation.mujoco.library import mujoco

DRAWN, MARKERS = 2, 1  # groups of geoms: what all cameras see, and what people see alone
_SKY, _LAMPS = 0.45, ((1.0, 1.0, -1.0), (0.0, 0.0, -1.0))
_BRIGHT = 0.35  # of each lamp


def add_lamps(spec: Any, *, shadows: bool) -> None:
    """Light a model from everywhere, from the side and from above, as SAPIEN's worlds are."""
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [_SKY] * 3, [0.0] * 3
    for number, direction in enumerate(_LAMPS):
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=direction,
            diffuse=[_BRIGHT] * 3,
            specular=[0.0] * 3,
            castshadow=shadows and not number,
        )


def add_drawn(spec: Any, body: Any, shape: Shape, geom: dict[str, Any], *, marker: bool) -> None:
    """Add what is drawn of a shape.

    Args:
        spec: MuJoCo's description of the model.
        body: The body in it.
        shape: The shape.
        geom: Type, pose and size of the geom that stands for it.
        marker: Whether only people see it.

    Raises:
        AssetError: If its mesh file cannot be read.
    """
    ghost = {"contype": 0, "conaffinity": 0, "mass": 0.0, "group": MARKERS if marker else DRAWN}
    if not isinstance(shape, Mesh):
        body.add_geom(**geom, **ghost, rgba=_as_screens_show(shape.color))
        return
    for mesh in load_meshes(str(shape.file), str(shape.file)):
        name = f"{body.name}/drawn{len(spec.meshes)}"
        spec.add_mesh(
            name=name,
            uservert=(np.asarray(mesh.vertices) * shape.scale).ravel().tolist(),
            userface=np.asarray(mesh.faces, int).ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        color = _own_color(mesh) if shape.textured else _as_screens_show(shape.color)
        body.add_geom(**{**geom, "meshname": name}, **ghost, rgba=color)


def _own_color(mesh: Any) -> list[float]:
    """Return the mean colour of a mesh's material, red, green, blue, alpha from 0 to 1."""
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if image is not None:
        return [*(np.asarray(image.convert("RGB")).reshape(-1, 3).mean(0) / 255).tolist(), 1.0]
    main = getattr(material, "main_color", (180, 180, 180, 255))
    return (np.asarray(main, float) / 255).tolist()


def _as_screens_show(color: tuple[float, float, float, float]) -> list[float]:
    """Return a colour, which is linear, as screens encode it; MuJoCo draws it as it is."""
    *light, alpha = color
    return [*(np.array(light) ** (1 / 2.2)).tolist(), alpha]
