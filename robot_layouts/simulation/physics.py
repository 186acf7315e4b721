"""Physics settings of a world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from objects.shapes import Friction
from robot_layouts.core.bounds import FAR, checked_number, shown
from robot_layouts.core.schema import check_fields, whole, within
from robots import SimulationError

_FLOATS = "timestep", "contact_offset", "rest_offset", "sleep_threshold", "bounce_threshold"
_Along = Annotated[float, within(-1e3, 1e3, "m/s²")]
_ROUNDING = 1e-6  # of a frequency that was written with seven digits
_LAST_BITS = 1e-12
_MOST_SUBSTEPS = 10_000  # of one control step: about a second of computing


@dataclass(frozen=True)
class PhysicsSettings:
    """How PhysX solves a world. The defaults are ManiSkill's.

    Source: mani_skill 3.0.1, utils/structs/types.py (SceneConfig, DefaultMaterialsConfig).

    Attributes:
        timestep: Length of one physics step (s).
        gravity: Acceleration in the world frame (m/s²).
        contact_offset: Distance at which contacts are generated (m).
        rest_offset: Distance at which bodies come to rest (m).
        position_iterations: Solver position iterations.
        velocity_iterations: Solver velocity iterations.
        sleep_threshold: Mass-normalised kinetic energy below which bodies sleep (J/kg).
        bounce_threshold: Relative speed below which contacts do not bounce (m/s).
        persistent_contacts: PhysX's persistent contact manifold.
        temporal_gauss_seidel: PhysX's TGS solver instead of PGS.
        continuous_collision: Continuous collision detection.
        enhanced_determinism: Results independent of other bodies in the scene.
        friction_every_iteration: Friction in every solver iteration.
        friction: Material of shapes that name none.
    """

    timestep: Annotated[float, within(1e-5, 0.1, "s")] = 1 / 100
    gravity: tuple[_Along, _Along, _Along] = (0.0, 0.0, -9.81)
    contact_offset: Annotated[float, within(0.0, 1.0, "m")] = 0.02
    rest_offset: Annotated[float, within(-1.0, 1.0, "m")] = 0.0
    position_iterations: Annotated[int, whole(1, 255)] = 15  # PhysX keeps bytes
    velocity_iterations: Annotated[int, whole(0, 255)] = 1
    sleep_threshold: Annotated[float, within(0.0, FAR, "J/kg")] = 0.005
    bounce_threshold: Annotated[float, within(1e-6, FAR, "m/s")] = 2.0
    persistent_contacts: bool = True
    temporal_gauss_seidel: bool = True
    continuous_collision: bool = False
    enhanced_determinism: bool = False
    friction_every_iteration: bool = True
    friction: Friction = Friction()

    def __post_init__(self) -> None:
        """Refuse settings that PhysX cannot solve a world with.

        Raises:
            SimulationError: If one has the wrong type or is out of range.
        """
        check_fields(self, SimulationError, "physics")
        given = vars(self)
        given.update({name: float(given[name]) for name in _FLOATS})
        given["gravity"] = tuple(map(float, self.gravity))
        if self.contact_offset <= self.rest_offset:
            raise SimulationError(
                f"contact_offset is {self.contact_offset} m and rest_offset {self.rest_offset} m;"
                " contacts must be generated before bodies rest: contact_offset > rest_offset"
            )


# The defaults of SAPIEN 3.0.3 (read from a fresh process).
SAPIEN_DEFAULTS = PhysicsSettings(
    contact_offset=0.01, position_iterations=10, friction=Friction(0.3, 0.3, 0.1)
)


def substeps(settings: PhysicsSettings, control_frequency: Any) -> int:
    """Return how many physics steps a control step takes.

    Args:
        settings: How the world is solved.
        control_frequency: Control steps per second (Hz).

    Raises:
        SimulationError: If that is no whole number, or more than 10,000; the message says which
            frequencies are nearest.
    """
    timestep = settings.timestep
    highest = (1 + _LAST_BITS) / timestep
    lowest = (1 - _LAST_BITS) / (timestep * _MOST_SUBSTEPS)
    unit = f"Hz, with 1 to {_MOST_SUBSTEPS} physics steps of {timestep:g} s in a control step"
    frequency = checked_number(
        "control_frequency", control_frequency, lowest, highest, SimulationError, unit
    )
    steps = 1 / (timestep * frequency)
    if abs(steps - round(steps)) > _ROUNDING * steps:
        nearest = [1 / (timestep * count) for count in (math.floor(steps), math.ceil(steps))]
        raise SimulationError(
            f"control_frequency is {shown(control_frequency)} Hz; a control step must be a whole"
            f" number of physics steps of {timestep:g} s: the nearest are"
            f" {nearest[0]:.8g} and {nearest[1]:.8g} Hz"
        )
    return round(steps)
