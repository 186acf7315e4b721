"""TwoArmTray: two arms lift a tray by its ends, and keep it level."""

from layouts import face_to_face
from tasks import Area, Cuboid, MultiRobotTask, closeness, register_task
from tasks.maths import maximum, norm, where


@register_task("TwoArmTray-v1")
class TwoArmTray(MultiRobotTask):
    """Lift a tray with a gripper at each end, level, to 20 cm."""

    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)  # m
    max_episode_steps = 100
    max_reward = 4

    tray = Cuboid((0.03, 0.3, 0.02), spawn=Area(x=(-0.05, 0.05), y=(-0.03, 0.03)))  # m

    def evaluate(self, state):
        """Success: high and level, held by both."""
        held = state.is_grasping("left", "tray") & state.is_grasping("right", "tray")
        high = state.position("tray")[:, 2] >= 0.2
        level = state.rotation("tray")[:, 2, 2] >= 0.99
        return {"held": held, "success": held & high & level}

    def observe(self, state, info):
        """The tray, and how far each hand is from its end; joints are observed anyway."""
        left, right = self.ways(state)
        return {"tray_pose": state.pose("tray"), "left_way": left, "right_way": right}

    def dense_reward(self, state, action, info):
        """Reach the ends (1), lift (3); 4 on success."""
        low = maximum(0.2 - state.position("tray")[:, 2], 0.0)
        left, right, lift = closeness(*map(norm, self.ways(state)), low)
        reward = where(info["held"], 2.0 + lift, (left + right) * 0.5)
        return where(info["success"], 4.0, reward)

    def ways(self, state):
        """From each hand to where it is to hold the tray, (N, 3) each (m)."""
        middle, along = state.position("tray"), state.rotation("tray")[:, :, 1] * 0.25
        left, right = state.tcp_position("left"), state.tcp_position("right")
        return middle - along - left, middle + along - right
