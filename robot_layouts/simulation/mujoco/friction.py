"""How surfaces rub in MuJoCo: at a contact, with the mean of both coefficients, as in SAPIEN.

MuJoCo itself takes the larger of both, or that of the geom of higher priority. So a surface whose
coefficient is not the world's usual one has priority and the mean of both; where two such surfaces
may meet, MuJoCo is given the mean of theirs as that of the pair.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.mujoco.bodies import PREFIX
from robot_layouts.simulation.world import World

_REST = (0.005, 0.0001)  # against twisting and rolling; MuJoCo's own


def set_friction(spec: Any, world: World, usual: float, solref: list[float]) -> None:
    """Give surfaces their priorities, and pairs of them their coefficients.

    Args:
        spec: Description of a model whose geoms have their own coefficients.
        world: What the model is of.
        usual: The world's usual coefficient.
        solref: How soft contacts are, in MuJoCo's numbers.
    """
    solid = [geom for geom in spec.geoms if geom.contype]
    unusual = [geom for geom in solid if geom.friction[0] != usual]
    owners = {PREFIX + name: body.part_of or name for name, body in world.bodies.items()}
    moving = [geom for geom in solid if _moves(owners.get(geom.parent.name), world)]
    for number, geom in enumerate([*moving, *unusual]):
        geom.name = geom.name or f"{PREFIX}geom{number}"
    names = {geom.name: geom for geom in unusual}
    done = set[frozenset[str]]()
    for one, other in product([*moving, *unusual], unusual):
        own = owners.get(one.parent.name), owners.get(other.parent.name)
        pair = frozenset((one.name, other.name))
        if own[0] == own[1] or pair in done:  # of one body, or both of robots
            continue
        if None not in own and not any(_moves(owner, world) for owner in own):
            continue
        done.add(pair)
        mean = (one.friction[0] + other.friction[0]) / 2
        spec.add_pair(
            geomname1=one.name,
            geomname2=other.name,
            friction=[mean, mean, _REST[0], _REST[1], _REST[1]],
            solref=solref,
        )
    for geom in names.values():
        geom.priority, geom.friction[0] = 1, (geom.friction[0] + usual) / 2


def _moves(owner: str | None, world: World) -> bool:
    return owner is not None and world.bodies[owner].kind == "dynamic"


def vary_friction(model: Any, coefficients: dict[int, float], usual: float) -> None:
    """Change the coefficients of bodies.

    Args:
        model: MuJoCo's model.
        coefficients: By MuJoCo's number of the body.
        usual: The world's usual coefficient.
    """
    own = _coefficients(model, usual)
    for body, coefficient in coefficients.items():
        geoms = model.geom_bodyid == body
        own[geoms], model.geom_priority[geoms] = coefficient, 1
        model.geom_friction[geoms, 0] = (coefficient + usual) / 2
    means = (own[model.pair_geom1] + own[model.pair_geom2]) / 2
    model.pair_friction[:, :2] = means[:, None]


def _coefficients(model: Any, usual: float) -> Floats:
    """Return the coefficient of each geom itself, (geoms,)."""
    taken: NDArray[np.float64] = model.geom_friction[:, 0]
    return np.where(model.geom_priority > 0, 2 * taken - usual, taken)
