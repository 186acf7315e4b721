"""Policies for tests, as functions of this process and as what a server answers with."""

import os
import pickle

import numpy as np

TASK, ACTIONS = "PushT-v1", 7


def leans(obs):
    """Depends on every number of each observation."""
    obs = np.asarray(obs, np.float32).reshape(-1)
    return np.tanh(obs[:ACTIONS] * 3 + obs.sum())


def leans_served(observation):
    assert observation["prompt"].endswith(".")
    return {"actions": leans(observation["state"])[None]}


class Chunks:
    """Chunks of 6 actions, a new number in each."""

    def __init__(self):
        self.asked = 0

    def __call__(self, observation):
        self.asked += 1
        return {"actions": np.full((6, ACTIONS), self.asked / 100, np.float32)}


class Session:
    """One action after the other, which says how often this session was asked, and sees joints."""

    def __init__(self):
        self.asked = 0

    def __call__(self, observation):
        assert observation["task_description"].endswith(".")
        self.asked += 1
        return {"actions": session_action(observation["state"], self.asked)}


def session_action(joints, asked):
    return (np.tanh(joints) / asked).astype(np.float32)


class Replays:
    """Carries out what is recorded where the observation is the recorded one, to the last bit."""

    CHUNK = 8

    def __init__(self, recording=None):
        import h5py

        self.chunks = {}
        with h5py.File(recording or os.environ["SERVED_RECORDING"]) as file:
            for episode in file.values():
                actions = episode["actions"][:]
                for t, seen in enumerate(episode["obs"][:-1]):
                    chunk = actions[t : t + self.CHUNK]
                    missing = self.CHUNK - len(chunk)
                    self.chunks[seen.tobytes()] = np.pad(chunk, ((0, missing), (0, 0)), "edge")

    def __call__(self, observation):
        if isinstance(observation, dict):
            return {"actions": self.chunks[observation["state"].tobytes()]}
        return self.chunks[observation.numpy().tobytes()][0]


class Writes:
    """Remembers what it was sent, in a file, and does nothing."""

    def __call__(self, observation):
        with open(os.environ["SERVED_FILE"], "wb") as file:
            pickle.dump(observation, file)
        return {"actions": np.zeros((1, int(os.environ["SERVED_ACTIONS"])), np.float32)}
