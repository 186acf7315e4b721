"""CleanRL: a script in one file, in the shape of its PPO for continuous actions."""

import sys
import time
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import torch
import tyro
from torch import nn
from torch.distributions.normal import Normal
from torch.utils.tensorboard import SummaryWriter

import tasks  # noqa: F401  # pyright: ignore[reportUnusedImport]


@dataclass
class Args:
    env_id: str = "RobotLayouts/PushCube-v1"
    seed: int = 1
    total_timesteps: int = 800
    learning_rate: float = 3e-4
    num_envs: int = 2
    num_steps: int = 200
    gamma: float = 0.99
    gae_lambda: float = 0.95
    num_minibatches: int = 4
    update_epochs: int = 2
    clip_coef: float = 0.2
    runs: str = "runs"


def make_env(env_id: str, gamma: float):
    def thunk():
        env = gym.make(env_id)
        env = gym.wrappers.FlattenObservation(env)
        env = gym.wrappers.RecordEpisodeStatistics(env)
        env = gym.wrappers.ClipAction(env)
        env = gym.wrappers.NormalizeObservation(env)
        env = gym.wrappers.TransformObservation(
            env, lambda obs: np.clip(obs, -10, 10), env.observation_space
        )
        env = gym.wrappers.NormalizeReward(env, gamma=gamma)
        return gym.wrappers.TransformReward(env, lambda reward: np.clip(reward, -10, 10))

    return thunk


def layer(inputs: int, outputs: int, std: float = 2**0.5) -> nn.Linear:
    made = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(made.weight, std)
    nn.init.constant_(made.bias, 0.0)
    return made


class Agent(nn.Module):
    def __init__(self, envs):
        super().__init__()
        size = int(np.prod(envs.single_observation_space.shape))
        actions = int(np.prod(envs.single_action_space.shape))
        self.critic = nn.Sequential(layer(size, 64), nn.Tanh(), layer(64, 1, 1.0))
        self.mean = nn.Sequential(layer(size, 64), nn.Tanh(), layer(64, actions, 0.01))
        self.logstd = nn.Parameter(torch.zeros(1, actions))

    def forward(self, obs, action=None):
        normal = Normal(self.mean(obs), self.logstd.exp().expand(len(obs), -1))
        action = normal.sample() if action is None else action
        return action, normal.log_prob(action).sum(1), self.critic(obs).flatten()


if __name__ == "__main__":
    args = tyro.cli(Args, args=["--runs", sys.argv[1]])
    writer = SummaryWriter(f"{args.runs}/{int(time.time())}")
    torch.manual_seed(args.seed)
    envs = gym.vector.SyncVectorEnv([make_env(args.env_id, args.gamma)] * args.num_envs)
    agent = Agent(envs)
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    steps, count = args.num_steps, args.num_envs
    obs = torch.zeros((steps, count, *envs.single_observation_space.shape))
    actions = torch.zeros((steps, count, *envs.single_action_space.shape))
    logprobs, rewards, dones, values = (torch.zeros(steps, count) for _ in range(4))
    global_step = finished = 0
    seen, _ = envs.reset(seed=args.seed)
    done = np.zeros(count)
    for _ in range(args.total_timesteps // (steps * count)):
        for step in range(steps):
            global_step += count
            obs[step], dones[step] = torch.Tensor(seen), torch.Tensor(done)
            with torch.no_grad():
                actions[step], logprobs[step], values[step] = agent(obs[step])
            seen, reward, ended, late, infos = envs.step(actions[step].numpy())
            done = np.logical_or(ended, late)
            rewards[step] = torch.tensor(reward)
            if "episode" in infos:
                for i in np.flatnonzero(infos["_episode"]):
                    finished += 1
                    writer.add_scalar("charts/return", infos["episode"]["r"][i], global_step)
                    writer.add_scalar("charts/success", infos["is_success"][i], global_step)
        with torch.no_grad():
            after = agent(torch.Tensor(seen))[2]
            advantages, last = torch.zeros_like(rewards), torch.zeros(count)
            for t in reversed(range(steps)):
                going = 1.0 - (torch.Tensor(done) if t == steps - 1 else dones[t + 1])
                following = after if t == steps - 1 else values[t + 1]
                delta = rewards[t] + args.gamma * following * going - values[t]
                last = advantages[t] = delta + args.gamma * args.gae_lambda * going * last
            returns = advantages + values
        flat = [x.flatten(0, 1) for x in (obs, actions, logprobs, advantages, returns)]
        for _ in range(args.update_epochs):
            for some in torch.randperm(steps * count).chunk(args.num_minibatches):
                b_obs, b_actions, b_logprobs, b_advantages, b_returns = (x[some] for x in flat)
                _, logprob, value = agent(b_obs, b_actions)
                ratio = (logprob - b_logprobs).exp()
                b_advantages = (b_advantages - b_advantages.mean()) / (b_advantages.std() + 1e-8)
                clipped = ratio.clamp(1 - args.clip_coef, 1 + args.clip_coef)
                policy_loss = torch.max(-b_advantages * ratio, -b_advantages * clipped).mean()
                loss = policy_loss + 0.5 * 0.5 * ((value - b_returns) ** 2).mean()
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
                optimizer.step()
    envs.close()
    writer.close()
    assert finished >= count * (args.total_timesteps // count // 51), finished
    assert all(parameter.isfinite().all() for parameter in agent.parameters())
