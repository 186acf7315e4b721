"""ServeCan: one arm stands a can on the mark, the other rings the bell; the task and its expert."""

from functools import partial

from layouts import face_to_face
from robot_layouts import experts
from robot_layouts.experts import CLOSED, OPEN, Waypoint
from tasks import Area, CellTask, Needs, Object, Target, register_task

TOP = 0.052  # of the bell (m)


@register_task("ServeCan-v1")
class ServeCan(CellTask):
    """Stand the can on the mark, then ring the bell."""

    instruction = ("Serve the can, then ring.", "Can first, then the bell.", "Serve and ring.")
    layout = face_to_face({"waiter": "panda", "ringer": "xarm7"}, spacing=1.4)  # m
    needs = {"waiter": Needs(fingers=True, opening=0.066)}
    max_episode_steps = 200
    stages = {"held": 0.3, "served": 0.7, "success": 1.0}

    can = Object("can", spawn=Area(x=(-0.2, -0.1), y=(-0.3, -0.2)))
    mark = Target(0.06, spawn=Area(x=(0.1, 0.2), y=(-0.3, -0.2)))
    bell = Object("button", kind="kinematic", spawn=Area(x=(-0.1, 0.1), y=(0.2, 0.3)))

    def evaluate(self, state):
        """Success: the bell is pressed while the can stands on the mark, let go."""
        held, low = state.is_grasping("waiter", "can"), state.position("can")[:, 2] < 0.01
        served = (state.planar_distance("can", "mark") < 0.04) & low & ~held
        rung = state.joint("bell", "cap") > 0.005
        return {"held": held, "served": served, "success": served & rung}

    def ways(self, state):
        """Of the hand to the can, of the can to the mark, of the tip to the bell."""
        hands = [state.tcp_distance("waiter", "can"), state.tcp_distance("ringer", "bell")]
        return [*hands, state.planar_distance("can", "mark")]


def serve(task, seed):
    """Return the actions (T, A) that solve the episode of a seed."""
    can = experts.thing_grips(ServeCan.can.descriptor, "can", 0.08, lean=0.1)

    def up(scene):
        return [(scene.tcp("waiter")[0] + (0.0, 0.0, 0.1), scene.tcp("waiter")[1])]

    def stand(scene, above):
        place = scene.body("mark")[0] + (0.0, 0.0, above)
        return experts.held_at(scene, "waiter", "can", place, [i / 2 for i in range(-4, 5)])

    def ring(scene, above):
        place = scene.body("bell")[0] + (0.0, 0.0, TOP + above)
        return [(place, experts.gripper_facing(yaw, 0.0)) for yaw in (-1.6, 0.0, 1.6)]

    waiter = [
        *experts.pick("waiter", "can", experts.in_reach(task, "waiter", can), ready=0.03),
        Waypoint("lift", up, CLOSED),
        Waypoint("over", partial(stand, above=0.1), CLOSED),
        Waypoint("down", partial(stand, above=0.002), CLOSED, near=0.02),
        Waypoint("let go", None, OPEN, steps=5),
    ]
    ringer = [
        Waypoint("wait", partial(ring, above=0.05)),
        Waypoint("ring", partial(ring, above=-0.02), after=("waiter.let go",), near=0.0),
    ]
    script = {"waiter": waiter, "ringer": ringer}
    return experts.first_success(task, seed, lambda scene: [script])


experts.register_expert(ServeCan.task_id, serve)
