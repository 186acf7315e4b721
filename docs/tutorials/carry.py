"""A policy for TwoArmTray-v1 in pd_ee_delta_pos: both arms look at the tray at every step."""

import torch

FULL = 0.1  # m that an action number of 1 asks for
ABOVE = 0.06  # m, from where a hand goes straight down
TURNS = {"left": (1, -1), "right": (-1, 1)}  # the world's y and x as each base's x and y


def move(way, on_its_way, lifting):
    """Where a hand goes, (N, 3) in the world (m): above its end, then down, then up with it."""
    aside = torch.linalg.vector_norm(way[:, :2], dim=1)
    goal = way.clone()
    goal[:, 2] += torch.where(aside > 0.02, ABOVE, 0.0)
    goal[:, 2] = torch.where(lifting, way[:, 2] + on_its_way, goal[:, 2])
    return goal


def carry(obs):
    """Observations of N trays as `obs_mode="state_dict"` has them -> actions (N, 8)."""
    tray, arms = obs["extra"]["tray_pose"], obs["agent"]
    ways = {"left": obs["extra"]["left_way"], "right": obs["extra"]["right_way"]}
    near = {arm: torch.linalg.vector_norm(way, dim=1) < 0.02 for arm, way in ways.items()}
    fingers = [arms[f"panda-{i}"]["qpos"][:, 7] for i in range(2)]
    lifting = near["left"] & near["right"] & (fingers[0] < 0.032) & (fingers[1] < 0.032)
    up = torch.clamp(0.23 - tray[:, 2], 0.0, 0.03)
    numbers = []
    for arm, way in ways.items():
        x, y, z = move(way, up, lifting).unbind(1)
        forth, aside = TURNS[arm]
        goal = torch.stack((forth * y, aside * x, z), 1) / FULL
        grip = torch.where(near[arm], -1.0, 1.0)[:, None]
        numbers += [goal.clamp(-0.6, 0.6), grip]
    return torch.cat(numbers, 1)


carry.batched = True
