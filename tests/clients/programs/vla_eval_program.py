"""vla-eval: an expert's episodes through its model server and runner are ours, to the last bit."""

import sys
from pathlib import Path
from queue import Queue
from threading import Thread

sys.path.append(str(Path(__file__).parents[3] / "integrations/vla_eval_robot_layouts"))

import anyio
import numpy as np
import pytest
import vla_eval
from vla_eval.model_servers.predict import PredictModelServer
from vla_eval.model_servers.serve import serve_async
from vla_eval.recording import NullEpisodeRecorder
from vla_eval.specs import DimSpec
from vla_eval_robot_layouts import RobotLayouts

import tasks
from robot_layouts.data import evaluate
from robot_layouts.experts import find_expert
from robot_layouts.simulation.rendering import vulkan_problem
from robots import TaskError, UnknownNameError

TASKS, FIRST, EPISODES = ("CellPutAndClose-v1", "TwoRobotPickCube-v1"), 3, 2
SHORT = {"max_episode_steps": 5}
rewards = []


class Kept(RobotLayouts):
    """Keeps the rewards of every episode."""

    def reset(self, task):
        rewards.append([])
        return super().reset(task)

    def step(self, action):
        found = super().step(action)
        rewards[-1].append(found.reward)
        return found


class Expert(PredictModelServer):
    """Carries out plans that are known, by task and episode."""

    def __init__(self, plans):
        super().__init__()
        self._plans, self.seen = plans, []

    async def on_episode_start(self, config, ctx):
        task = config["task"]
        self._left = iter(self._plans[task["name"], task["episode_idx"]])
        await super().on_episode_start(config, ctx)

    def predict(self, obs, ctx):
        self.seen.append(obs)
        return {"actions": next(self._left)}

    def get_action_spec(self):
        return {"actions": DimSpec("actions", 0, "pd_joint_delta_pos")}

    def get_observation_spec(self):
        return {"state": DimSpec("state", 0, "joint_positions")}


def plans_of(name):
    task, expert = tasks.make(name), find_expert(name)
    found = {(name, i): np.asarray(expert(task, FIRST + i)) for i in range(EPISODES)}
    task.close()
    return found


def rewards_here(name, plan, seed):
    task, found = tasks.make(name), []
    task.reset(seed, {"reconfigure": True})
    for action in plan:
        _, reward, terminated, truncated, _ = task.step(action)
        found.append(reward[0].item())
        if terminated[0] or truncated[0]:
            break
    task.close()
    return found


def config(**params):
    return {
        "output_dir": sys.argv[1],
        "benchmarks": [
            {
                "benchmark": f"{__name__}:Kept",
                "episodes_per_task": EPISODES,
                "params": {"tasks": list(TASKS), "first_seed": FIRST, "cameras": False, **params},
            }
        ],
    }


def episodes_are_ours():
    plans = {key: plan for name in TASKS for key, plan in plans_of(name).items()}
    server = Expert(plans)
    (result,) = vla_eval.evaluate(server, config(), no_save=True, docker=False)
    assert [task["task"] for task in result["tasks"]] == list(TASKS)
    for task in result["tasks"]:
        name = task["task"]
        ours = evaluate("expert", name, range(FIRST, FIRST + EPISODES), workers=0)
        theirs = task["episodes"]
        assert [one["metrics"]["success"] for one in theirs] == list(ours.successes.values())
        assert [one["steps"] for one in theirs] == list(ours.lengths.values())
        if name.startswith("Cell"):
            scores = list(ours.stage_scores.values())
            assert [one["metrics"]["stage_score"] for one in theirs] == scores
    assert rewards == [rewards_here(name, plan, FIRST + i) for (name, i), plan in plans.items()]
    assert server.seen[0]["state"].shape == (driven(TASKS[0]),)
    assert server.seen[0]["task_description"].endswith(".")


class Pulls(PredictModelServer):
    """Chunks of four actions, of joints where each chunk begins."""

    def predict(self, obs, ctx):
        return {"actions": pulls(obs["state"])}


def pulls(joints):
    return np.tile(-np.tanh(joints), (4, 1)).astype(np.float32)


class PullsHere:
    def __init__(self):
        self.ahead = []

    def __call__(self, obs):
        if not self.ahead:
            self.ahead = [*pulls(obs["agent"]["qpos"][0].numpy())]
        return self.ahead.pop(0)


def model_servers_act_as_policies_do_here():
    ports = Queue()

    async def serve():
        async with anyio.create_task_group() as group:
            ports.put(await group.start(serve_async, Pulls(chunk_size=4), "127.0.0.1", 0))

    Thread(target=anyio.run, args=(serve,), daemon=True).start()
    address = f"vla-eval+ws://127.0.0.1:{ports.get()}"
    making = {"workers": 0, "obs_mode": "state_dict", "max_episode_steps": 10}
    here = evaluate(PullsHere(), "PushT-v1", range(3), **making)
    for together in (1, 2):
        served = evaluate(address, "PushT-v1", range(3), num_envs=together, **making)
        assert served.scores == here.scores


def driven(name):
    """Return how many numbers the joint actions of a task have."""
    cls = tasks.get_task_class(name)
    return sum(placed.robot.action_dim for placed in cls.layout.values())


def pictures_are_seen():
    body = RobotLayouts(["TwoRobotPickCube-v1"], making={"camera_size": (64, 48), **SHORT})
    assert body.get_metadata()["max_steps"] == 5
    assert body.get_action_spec()["actions"].dims == 16
    (task,) = body.get_tasks()
    body._recorder = NullEpisodeRecorder()
    seen = body.make_obs(body.reset({**task, "episode_idx": 0}), task)
    assert {name: each.shape for name, each in seen["images"].items()} == dict.fromkeys(
        ("base_camera", "panda_wristcam-0-hand_camera", "panda_wristcam-1-hand_camera"), (48, 64, 3)
    )
    body.cleanup()


def what_is_wrong_is_said():
    with pytest.raises(UnknownNameError, match="Did you mean 'CellPutAndClose-v1'"):
        RobotLayouts(["CellPutAndClos-v1"])
    with pytest.raises(TaskError, match="no task is named"):
        RobotLayouts([])


if __name__ == "__main__":
    what_is_wrong_is_said()
    episodes_are_ours()
    model_servers_act_as_policies_do_here()
    if vulkan_problem() is None:
        pictures_are_seen()
