"""CellSqueezeBox: two tips press and rise in step, wait for the plinth, and come down again."""

from __future__ import annotations

from functools import partial
from math import pi

import numpy as np

from robot_layouts.experts.cells.moves import stand_back
from robot_layouts.experts.cells.tips import push
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import CLOSED, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.cells.squeeze_box import BOX, HIGH, PLINTH

SIDES = {"west": -1.0, "east": 1.0}
GAP, OVER = 0.09, 0.1  # of tips before the box's sides, and higher than where they press (m)
HELD = 0.085  # m; height of the tips when they press: hands stay above the box
LEANS = (0.15, 0.3, 0.45, 0.6)  # of tips that do not reach there upright (rad)
LEGS, RAISED = 5, HIGH + 0.04  # in how many steps it is lifted, and how far (m)
OVER_PLINTH = {"down 0": 0.5}  # how far of its way over the plinth the box goes; then all of it
# How deep tips press (m), strokes of the push, and whether tips first come near until they touch,
# and press from there on: needed where flanges or fingers reach out beyond the tip.
TRIED = (
    (0.012, 28, False),
    (0.012, 36, False),
    (0.008, 24, False),
    (0.012, 28, True),
    (0.006, 28, True),
    (0.02, 36, True),
)
GENTLE = 0.1  # share of its greatest speed at which a tip comes near


def squeeze_box(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that set the box on the plinth.

    Raises:
        TaskError: If an arm cannot reach what it should.
    """
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, *tried) for tried in TRIED],
        as_declared=True,
    )


def _script(task: TaskEnv, deep: float, strokes: int, felt: bool) -> Script:
    start: list[Floats] = []  # where the box stood

    def under(scene: Scene) -> Floats:
        return scene.body("box")[0]

    pushing = push(
        task, "pusher", "plinth", under, strokes=strokes, gap=0.2, after=[f"west.up {LEGS - 1}"]
    )
    return {
        "pusher": (*pushing, stand_back(task, "pusher")),
        **{arm: _pressing(task, arm, deep, start, felt) for arm in SIDES},
    }


def _pressing(
    task: TaskEnv, arm: str, deep: float, start: list[Floats], felt: bool
) -> tuple[Waypoint, ...]:
    (other,) = (each for each in SIDES if each != arm)
    side = [0.0]  # how far outside the box's side its tip is when it touches that (m)
    lean = {"leans": (0.0,), "farther": LEANS}
    go = partial(reaching, task, arm, **lean, as_it_is=False, gripper=CLOSED)

    def beside(scene: Scene, out: float, up: float, over: float = 0.0) -> Floats:
        """Return a place beside the box, where it stood or that far on its way over the plinth."""
        start[:] = start or [scene.body("box")[0]]
        x, y, _ = start[0] + over * (scene.body("plinth")[0] - start[0])
        return np.array([x + SIDES[arm] * (BOX[0] + out), y, HELD + up])

    def touched(scene: Scene) -> Floats:
        """Return where the tip is; from there on it presses."""
        start[:] = [scene.body("box")[0]]
        side[0] = SIDES[arm] * (scene.tcp(arm)[0] - start[0])[0] - BOX[0]
        return beside(scene, side[0], 0.0)

    def pressed(scene: Scene, up: float, over: float) -> Floats:
        return beside(scene, side[0] - deep, up, over)

    def touches(scene: Scene) -> bool:
        return scene.touches(arm, "box")

    def step(name: str, up: float, before: str) -> Waypoint:
        over = OVER_PLINTH.get(name, float(name.startswith("down")))
        place = partial(pressed, up=up, over=over)
        after = (f"{other}.{before}", *(("pusher.away plinth",) if name == "down 0" else ()))
        return go(name, place, near=pi, steps=6, after=after)

    ups = [RAISED * (leg + 1) / LEGS for leg in range(LEGS)]
    downs = [RAISED + (2 * PLINTH[2] - RAISED) * (leg + 1) / LEGS for leg in range(LEGS)]
    steps = {"squeeze": 0.0} | {f"up {i}": up for i, up in enumerate(ups)}
    steps |= {f"down {i}": up for i, up in enumerate(downs)}
    near, ready = partial(beside, out=-GAP, up=0.0), "felt" if felt else "beside"
    feel = (
        go("near", near, near=pi, until=touches, pace=GENTLE, after=(f"{other}.beside",)),
        go("felt", touched, near=pi, steps=1),
    )
    before = dict(zip(steps, [ready, *steps], strict=False))
    return (
        go("over", partial(beside, out=GAP, up=OVER), near=0.05),
        go("beside", partial(beside, out=GAP, up=0.0), near=0.03),
        *(feel if felt else ()),
        *(step(name, up, before[name]) for name, up in steps.items()),
        go(
            "leave",
            partial(beside, out=GAP, up=2 * PLINTH[2], over=1.0),
            near=0.05,
            after=(f"{other}.down {LEGS - 1}",),
        ),
    )
