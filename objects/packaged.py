"""Things whose files packages on the index bring: which there are, and what was measured of them.

Nothing is fetched until one is loaded. How they rest and where they are held was tried in physics
by ``python -m benchmarks packaged`` and stands in ``packaged.json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from objects.descriptor import Grasp, ObjectDescriptor
from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.files import read_text
from robots.assets.locator import UrdfLocator
from robots.assets.manifest import load_manifest

MEASURED = Path(__file__).with_name("packaged.json")
_LARGEST = 1 << 24  # bytes


@dataclass(frozen=True)
class PackagedObject:
    """A thing of a package, or many of them that a seed draws from.

    Attributes:
        name: Registry name.
        about: What it is, in a few words.
        package: Package of the manifest that its file is in.
        file: A mesh or an MJCF there; of many, with their number in braces.
        details: What `ObjectDescriptor.from_mesh` or `from_mjcf` is given besides.
        members: How many there are.
    """

    name: str
    about: str
    package: str
    file: str
    details: Mapping[str, Any] = field(default_factory=dict[str, Any], hash=False)
    members: int = 1

    @property
    def licence(self) -> str:
        """Of its files, as SPDX writes it."""
        return load_manifest().package(self.package).origin.licence

    def load(
        self, seed: int | None = None, *, measured: bool = True, most_grasps: int = 48
    ) -> ObjectDescriptor:
        """Return it, made of its file, which is fetched if it is not in the local copy.

        Args:
            seed: Which of its members; None takes the first.
            measured: Whether its rests and grasps are those that were tried in physics; else they
                are those that its shape suggests.
            most_grasps: How many its shape may suggest.

        Raises:
            DescriptorError: If a seed is given, and there is one of it alone.
            AssetError: If no source has its file.
            MissingPackageError: If its file needs a package that is not installed.
        """
        if seed is not None and self.members == 1:
            raise DescriptorError(f"the object {self.name!r} is a single thing; it has no family")
        number = 0
        if seed is not None:
            number = checked_whole(f"{self.name}: seed", seed, 0, None, DescriptorError)
        file = self.file.format(number % self.members)
        path = UrdfLocator(self.package, file).locate(pictures=True)
        thing = _made(self, path, file, measured, most_grasps)
        return thing if seed is None else replace(thing, seed=seed)


@lru_cache(maxsize=256)  # what `locate` finds is as the manifest says, every time
def _made(
    thing: PackagedObject, path: Path, file: str, measured: bool, most_grasps: int
) -> ObjectDescriptor:
    origin = load_manifest().package(thing.package).origin
    given: dict[str, Any] = {
        "about": thing.about,
        "source": f"{origin.wheel}, {file}",
        "licence": origin.licence,
        "most_grasps": most_grasps,
        **thing.details,
    }
    known = measurements().get(thing.name) if measured and thing.members == 1 else None
    if known:
        rests = {name: tuple(turn) for name, turn in known["rests"].items()}
        grasps = tuple(_grasp(row) for row in known["grasps"])
        given |= {"rests": rests, "grasps": grasps}
    if file.endswith(".xml"):
        return ObjectDescriptor.from_mjcf(path, thing.name, **given)
    return ObjectDescriptor.from_mesh(path, thing.name, **given)


def _grasp(row: list[Any]) -> Grasp:
    x, y, z, a, b, c, d, opening, part = row
    return Grasp((x, y, z), (a, b, c, d), opening, part)


@lru_cache(maxsize=1)
def measurements() -> dict[str, dict[str, Any]]:
    """Return what was tried of things by name: ``rests`` and ``grasps`` that held."""
    return json.loads(read_text(MEASURED, _LARGEST))


def _kitchen(name: str, about: str, body: str, mass: float) -> PackagedObject:
    folder = "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets"
    path, details = f"{folder}/kitchen_env_model.xml", {"body": body, "mass": mass}
    return PackagedObject(f"kitchen_{name}", about, "gymnasium_robotics_objects", path, details)


def _metaworld(name: str, about: str, file: str, mass: float | None = None) -> PackagedObject:
    details = {"body": 2, "mass": mass}  # 0 and 1 are the table and the wall behind it
    path = f"metaworld/assets/objects/{file}.xml"
    return PackagedObject(f"metaworld_{name}", about, "metaworld_objects", path, details)


def _robosuite(name: str, about: str, mass: float) -> PackagedObject:
    path = f"robosuite/models/assets/objects/{name.replace('_', '-')}.xml"
    return PackagedObject(f"robosuite_{name}", about, "robosuite_objects", path, {"mass": mass})


def _pybullet(name: str, about: str, file: str, members: int = 1, **details: Any) -> PackagedObject:
    path = f"pybullet_data/{file}"
    return PackagedObject(f"pybullet_{name}", about, "pybullet_objects", path, details, members)


# Masses that are given here are typical of such things; those of the files are of no real thing.
_ALL = (
    _kitchen("hinge_cabinet", "A cabinet with two doors", "hingecabinet", 15.0),
    _kitchen("kettle", "A kettle with a handle above it", "kettleroot", 0.9),
    _kitchen("microwave", "A microwave oven", "microroot", 12.0),
    _kitchen("slide_cabinet", "A cabinet with a door that slides", "slide", 15.0),
    _metaworld("ring", "A ring with a handle, to be put over a peg", "assembly_peg"),
    _metaworld("bin", "An open bin", "binA"),
    _metaworld("button_box", "A box with a button on its side", "buttonbox", 1.5),
    _metaworld("club", "A golf club, short", "club"),
    _metaworld("coffee_machine", "A coffee machine with a button", "coffeemachine", 3.0),
    _metaworld("door", "A door in its frame", "doorlockB", 4.0),
    _metaworld("door_lock", "A door with a lever that locks it", "doorlockA", 4.0),
    _metaworld("drawer", "A drawer in its case", "drawer"),
    _metaworld("faucet", "A faucet whose handle turns", "faucet"),
    _metaworld("goal", "A goal of a table football", "soccer_goal"),
    _metaworld("hammer", "A mallet", "hammer", 0.6),
    _metaworld("handle_press", "A handle that is pressed down", "handle_press", 2.0),
    _metaworld("hoop", "A hoop of basketball", "basketballhoop"),
    _metaworld("laptop", "A laptop that is open", "laptop", 2.0),
    _metaworld("lever", "A lever on a stand", "lever", 2.0),
    _metaworld("mug", "A mug", "mug"),
    _metaworld("nail_block", "A block with a nail that is driven in", "hammerblock", 2.0),
    _metaworld("peg", "A square rod", "peg_insert"),
    _metaworld("peg_block", "A block with a hole for a rod", "peg_block", 2.0),
    _metaworld("plug", "A plug with a handle", "plug"),
    _metaworld("plug_wall", "A wall with a hole for a plug", "plug_wall"),
    _metaworld("shelf", "A shelf", "shelf", 3.0),
    _metaworld("stick", "A short stick", "stick", 0.05),
    _metaworld("window", "A window that is pushed up", "window"),
    _metaworld("window_sideways", "A window that is pushed aside", "window_horiz"),
    _pybullet("duck", "A rubber duck", "duck_vhacd.obj", scale=0.05, up="y", mass=0.08),
    _pybullet("teddy", "A small teddy bear", "teddy2_VHACD_CHs.obj", scale=0.1, mass=0.1),
    _pybullet(
        "random",
        "A thing of a random shape",
        "random_urdfs/{0:03}/{0:03}.obj",
        members=1000,
        scale=0.015,
        mass=0.1,
    ),
    _robosuite("bottle", "A bottle", 0.25),
    _robosuite("bread", "A slice of bread", 0.06),
    _robosuite("can", "A can", 0.25),
    _robosuite("cereal", "A box of cereal", 0.2),
    _robosuite("lemon", "A lemon", 0.08),
    _robosuite("milk", "A carton of milk", 0.25),
    _robosuite("round_nut", "A round ring with a handle", 0.1),
    _robosuite("square_nut", "A square ring with a handle", 0.1),
)
PACKAGED: Mapping[str, PackagedObject] = MappingProxyType({one.name: one for one in _ALL})
