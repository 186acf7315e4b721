"""PutAway: one arm opens a drawer, the other puts a can into it; the task and its expert."""

from math import pi

from layouts import face_to_face
from robot_layouts import experts
from robot_layouts.experts import CLOSED, OPEN, Waypoint
from tasks import Area, MultiRobotTask, Object, register_task

OPENED = 0.15  # m
ABOVE = (0.0, -0.03, 0.14)  # m; from the drawer to where the can is let go


@register_task("PutAway-v1")
class PutAway(MultiRobotTask):
    """Open the drawer and put the can into it."""

    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.4)  # m
    max_episode_steps = 200

    case = Object("drawer", kind="kinematic", spawn=Area(x=(0.27, 0.31), y=0.2, yaw=-pi / 2))
    can = Object("can", spawn=Area(x=(-0.1, 0.0), y=(0.2, 0.3)))

    def evaluate(self, state):
        """Success: the drawer is open, and the can lies in it, let go."""
        opened = state.joint("case", "drawer") > 0.8 * OPENED
        inside = state.planar_distance("case.drawer", "can") < 0.1
        low = state.position("can")[:, 2] < 0.12
        return {"opened": opened, "success": opened & inside & low & ~self.held(state)}

    def held(self, state):
        """Whether the right arm has the can, (N,)."""
        return state.is_grasping("right", "can")


def lifted(scene):
    """Where the right gripper is now, but 20 cm higher."""
    position, quaternion = scene.tcp("right")
    return [(position + (0.0, 0.0, 0.2), quaternion)]


def over(scene):
    """Where the right gripper has the can over the drawer, turned in several ways."""
    place = scene.body("case.drawer")[0] + ABOVE
    return experts.held_at(scene, "right", "can", place, [yaw / 2 for yaw in range(-4, 5)])


def put_away(task, seed):
    """Return the actions (T, A) that solve the episode of a seed."""
    experts.need_fingers(task, "putting the can away", "left", "right")
    handle = experts.thing_grips(PutAway.case.descriptor, "case", 0.08, lean=pi / 2)
    can = experts.thing_grips(PutAway.can.descriptor, "can", 0.08, lean=0.1)
    exactly = {"ready": 0.03, "around": 0.01}  # rad; handles are thin

    def pull(scene, grip):
        return [
            experts.moved_along(scene, "case", "drawer", at, grip) for at in (0.05, 0.1, OPENED)
        ]

    handle = experts.in_reach(task, "left", handle, on=pull)
    can = experts.in_reach(task, "right", can)
    script = {
        "left": [
            *experts.pick("left", "case.drawer", handle, **exactly),
            *experts.move_joint("left", "case", "drawer", OPENED),
        ],
        "right": [
            *experts.pick("right", "can", can, **exactly),
            Waypoint("lift", lifted, CLOSED),
            Waypoint("over", over, CLOSED, after=("left.case.drawer 7",)),
            Waypoint("let go", None, OPEN, steps=15),
        ],
    }
    return experts.first_success(task, seed, lambda scene: [script])


experts.register_expert(PutAway.task_id, put_away)
