"""A toy with AdaptNet's observations, and a small AdaptNet for it."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.agents.adaptnet.ensemble import EnsembleConfig
from murmillo.agents.common.base import Base
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy_tasks import Heading

FRAMES = 4


class Wanderer(Heading):
    """Point masses with a direction as their "goal" `[N, 2]`, whose "state" `[N, 4, 4]` is a history.

    The frames since an episode began stand first, "length" `[N]` of them; behind them are zeros. The discriminators see
    velocities only, "window" `[N, 3, 2]`. Actions that are `turned` by an angle [rad] do something else than a base has
    learned; with `heights` there is a map to be seen, with numbers that mean nothing.
    """

    def __init__(self, num_envs: int, *, turned: float = 0.0, heights: bool = False, **arguments: Any) -> None:
        super().__init__(num_envs, window=FRAMES, **arguments)
        self.turn = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]], np.float32)
        self.heights = heights
        shapes = {"state": (FRAMES, 4), "goal": (2,), "window": (3, 2)} | ({"heights": (35, 35)} if heights else {})
        boxes = {name: spaces.Box(-np.inf, np.inf, shape, np.float32) for name, shape in shapes.items()}
        self.single_observation_space = spaces.Dict({**boxes, "length": spaces.Discrete(FRAMES, start=1)})
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def step(self, actions: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict]:
        return super().step(actions @ self.turn)

    def velocity(self, obs: dict[str, np.ndarray]) -> np.ndarray:
        return obs["window"][:, -1]

    def _obs(self) -> dict[str, np.ndarray]:
        obs = super()._obs()
        history = obs["window"]
        length = np.minimum(self.clock + 1, FRAMES)
        frame = np.arange(FRAMES)[None]
        packed = np.take_along_axis(history, ((frame + FRAMES - length[:, None]) % FRAMES)[..., None], 1)
        packed = np.where((frame < length[:, None])[..., None], packed, 0).astype(np.float32)
        seen = {"state": packed, "length": length, "goal": obs["goal"], "window": history[:, -3:, 2:]}
        if self.heights:
            cells = np.arange(35 * 35, dtype=np.float32)
            seen["heights"] = np.sin(cells * (1 + history[:, -1, :1])).reshape(-1, 35, 35)
        return seen

    def demonstrations(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        frames: int | None = None,
        rows: Tensor | slice | None = None,
    ) -> dict[str, Tensor]:
        drawn = super().demonstrations(n, generator, skill, frames or 3, rows)
        return {**drawn, "window": drawn["window"][..., 2:]}


def small_adaptnet(**changes: Any) -> AdaptNetConfig:
    """AdaptNet with networks and steps that fit the toy."""
    sizes: dict[str, Any] = {"hidden": (32, 32), "epochs": 2, "minibatch": 128}
    steps: dict[str, Any] = {"std": 0.1, "policy_learning_rate": 3e-3, "value_learning_rate": 3e-3}
    ppo = dataclasses.replace(AdaptNetConfig().ppo, **sizes, **steps)
    discriminator = EnsembleConfig(recurrent=16, hidden=(32, 16), heads=8, learning_rate=1e-3, minibatch=256)
    fields = {"window": 3, "recurrent": 16, "ppo": ppo, "discriminator": discriminator}
    return AdaptNetConfig(**{**fields, **changes})


def make_adaptnet(env: VectorEnv, generator: torch.Generator, base: Base | None = None, **changes: Any) -> AdaptNet:
    return AdaptNet(env, env.demonstrations, small_adaptnet(**changes), generator, base)  # type: ignore[attr-defined]


def make_base(seed: int = 0, **arguments: Any) -> Base:
    """A base policy that knows the scale of its states and whose actions are not all alike."""
    env = Wanderer(16, **arguments)
    agent = make_adaptnet(env, torch.Generator().manual_seed(seed))
    agent.model.state_normalizer.update(torch.randn(500, 4, generator=agent.generator) * torch.tensor([1, 2, 3, 4.0]))
    with torch.no_grad():
        agent.model.policy.head.weight *= 5
    return Base.of(agent.model.state_dict())


def toy_runner(
    folder: Path, env: Wanderer, iterations: int, base: Base | None = None, seed: int = 0, **agent: Any
) -> Runner:
    """A runner with the weights and the end of AdaptNet, in milder measure."""
    generator = torch.Generator().manual_seed(seed)
    weights = {"task": 0.5, "imitation": 0.5}
    config = RunnerConfig(
        samples=iterations * env.num_envs * 8,
        horizon=8,
        gamma=0.9,
        lam=0.9,
        reward_weights=weights,
        termination_reward=-5.0,
    )
    return Runner(env, make_adaptnet(env, generator, base, **agent), config, generator, folder)
