"""Which things there are: the built-in families, registered descriptors, and entry points."""

from __future__ import annotations

from objects.descriptor import ObjectDescriptor
from objects.family import Family
from objects.packaged import PACKAGED, PackagedObject
from robot_layouts.core.catalogue import Catalogue
from robot_layouts.core.errors import DescriptorError, RobotLayoutsError
from robot_layouts.core.quoting import shown

# Families by the module that makes them; each is an attribute of the same name there.
_FAMILIES = {
    "containers": ("box", "box_lid", "pallet", "rack", "tote", "tray"),
    "controls": (
        *("button", "crank", "dial", "gate", "latch", "lever", "rocker", "seesaw", "slider"),
        *("tap", "toaster", "turntable", "valve"),
    ),
    "furniture": (
        *("chest", "cupboard", "drawer", "hinged_box", "laptop", "screw_jar", "swing_bin"),
        "window",
    ),
    "joining": ("bolt", "bracket", "gear", "nut", "outlet", "peg", "plug", "shaft", "socket"),
    "stock": ("beam", "board", "brick", "hammer", "screwdriver", "spoon"),
    "two_handed": (
        *("coffee_press", "drop_leaf_table", "interlock", "pepper_mill", "suitcase"),
        *("two_hand_control", "wardrobe"),
    ),
    "vessels": (
        *("bottle", "bottle_cap", "bowl", "can", "cup", "jug", "mug", "pan", "plate"),
        *("pot_lid", "pot_two_handles"),
    ),
}
CATALOGUE = {
    name: f"objects.families.{module}:{name}"
    for name, module in sorted((name, at) for at, names in _FAMILIES.items() for name in names)
}


def checked_object(
    given: object, origin: str, name: str | None = None
) -> ObjectDescriptor | Family:
    """Return a thing or a family that came from elsewhere, if it is one and goes by its name.

    Raises:
        DescriptorError: If not.
    """
    if not isinstance(given, ObjectDescriptor | Family):
        raise DescriptorError(
            f"{origin} gave {shown(given)}, of type {type(given).__name__};"
            " an ObjectDescriptor or a Family is needed"
        )
    if name is not None and given.name != name:
        raise DescriptorError(f"{origin} is listed as {name!r}, but its object is {given.name!r}")
    return given


OBJECTS: Catalogue[ObjectDescriptor | Family] = Catalogue(
    "object",
    CATALOGUE,
    group="robot_layouts.objects",
    check=checked_object,
    error=DescriptorError,
    hint="`robot-layouts objects list` has all; ObjectRegistry.register(descriptor) adds your own.",
)


class ObjectRegistry:
    """The names under which things are known in this process."""

    @staticmethod
    def load(name: str, seed: int | None = None) -> ObjectDescriptor:
        """Return the thing registered under ``name``.

        Looks at what was registered in this process, then at the built-in families, then at the
        entry points ``robot_layouts.objects`` of installed packages. What `packaged` lists is made
        of files, which are fetched if they are not in the local copy.

        Args:
            name: Its name.
            seed: Draws a member of its family; None takes the usual one.

        Raises:
            UnknownNameError: If nothing has that name (also a ``KeyError``).
            DescriptorError: If it has no family that a seed could draw from, or another package
                brings it, and that goes wrong.
            AssetError: If no source has its files.
            MissingPackageError: If its files need a package that is not installed.
        """
        if isinstance(packaged := _found(name), PackagedObject):
            return packaged.load(seed)
        found = ObjectRegistry.family(name) if seed is not None else packaged
        if isinstance(found, ObjectDescriptor):
            return found
        return found.usual if seed is None else found.member(seed)

    @staticmethod
    def family(name: str) -> Family:
        """Return the family registered under ``name``.

        Raises:
            UnknownNameError: If nothing has that name (also a ``KeyError``).
            DescriptorError: If that is a single thing.
        """
        found = _found(name)
        if not isinstance(found, Family):
            raise DescriptorError(f"the object {name!r} is a single thing; it has no family")
        return found

    @staticmethod
    def names() -> tuple[str, ...]:
        """Return the names of what needs no file of others, sorted."""
        return tuple(OBJECTS)

    @staticmethod
    def packaged() -> tuple[str, ...]:
        """Return the names of what is made of files that packages on the index bring, sorted."""
        return tuple(sorted(PACKAGED))

    @staticmethod
    def load_all() -> tuple[list[ObjectDescriptor], list[RobotLayoutsError]]:
        """Return everything, sorted by name, and why those of other packages fail that do so."""
        found, failures = OBJECTS.load_all()
        return [one.usual if isinstance(one, Family) else one for one in found], failures

    @staticmethod
    def register(thing: ObjectDescriptor | Family) -> ObjectDescriptor | Family:
        """Make a thing or a family loadable by its name in this process, and return it.

        Registering the same one again is allowed.

        Raises:
            DescriptorError: If it is neither, or another one has that name.
        """
        name = checked_object(thing, "register").name
        if name in PACKAGED:
            raise DescriptorError(f"another object is already called {name!r}, of a package")
        OBJECTS.add(name, thing)
        return thing


def _found(name: str) -> ObjectDescriptor | Family | PackagedObject:
    if not isinstance(name, str):
        raise OBJECTS.unknown(f"of type {type(name).__name__}", "It takes an object's name.")
    return PACKAGED[name] if name in PACKAGED else OBJECTS[name]
