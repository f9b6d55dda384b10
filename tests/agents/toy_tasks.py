"""A task on the toy, and a low-level agent that can be foreseen."""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from murmillo.agents.case.high_level import HybridConfig, hybrid_agent
from murmillo.agents.common.interface import Obs, Step
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.task_agent import TaskAgent, TaskAgentConfig
from tests.agents.toy import PointMass, small_ase


class Heading(PointMass):
    """Point masses that are to move into a direction, their "goal" `[N, 2]`. Reward: the velocity along it."""

    def __init__(self, num_envs: int, **arguments: Any) -> None:
        super().__init__(num_envs, **arguments)
        assert isinstance(self.single_observation_space, spaces.Dict)
        goal = spaces.Box(-1, 1, (2,), np.float32)
        self.single_observation_space = spaces.Dict({**self.single_observation_space.spaces, "goal": goal})
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.goal = np.zeros((num_envs, 2), np.float32)

    def step(self, actions: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, np.ndarray, dict]:
        goal = self.goal.copy()
        obs, speed, terminated, truncated, infos = super().step(actions)
        along = (self.velocity(infos["final_obs"]) * goal).sum(1).astype(np.float64)
        infos |= {"reward_terms": {"along": along}, "side_rewards": {"speed": speed}}
        return obs, along, terminated, truncated, infos

    def velocity(self, obs: dict[str, np.ndarray]) -> np.ndarray:
        """`[N, 2]`."""
        return obs["state"][:, 2:]

    def observation(self) -> dict[str, np.ndarray]:
        return self._obs()

    def _begin(self, worlds: np.ndarray) -> None:
        super()._begin(worlds)
        angle = 2 * np.pi * torch.rand(int(worlds.sum()), generator=self.rng).numpy()
        self.goal[worlds] = np.stack([np.cos(angle), np.sin(angle)], 1)

    def _obs(self) -> dict[str, np.ndarray]:
        return {**super()._obs(), "goal": self.goal.copy()}

    def state_dict(self) -> dict[str, Tensor]:
        return {**super().state_dict(), "goal": torch.from_numpy(self.goal.copy())}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        super().load_state_dict(state)
        self.goal = state["goal"].numpy().copy()


class Compass:
    """Goes where the first two of three numbers of its latent point, and the other way under skill 1.

    Its "style" is the x that a step ends at, plus noise of its generator; it notes what it was told.
    """

    needs = frozenset({"next_state"})
    latent_dim = 3

    def __init__(self, noise: float = 0.0) -> None:
        self.generator = torch.Generator().manual_seed(5)
        self.noise = noise
        self.seen: list[tuple[Tensor, Tensor]] = []

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        assert deterministic
        self.seen.append((self.latent, obs["skill"]))
        turned = torch.where(obs["skill"] == 1, -1, 1)[:, None]
        return Step(turned * self.latent[:, :2], torch.zeros(len(turned)), {"latent": self.latent})

    def follow(self, latent: Tensor) -> None:
        self.latent = latent

    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        x = rollout["next_state"][..., 0]
        return {"style": x + self.noise * torch.randn(x.shape, generator=self.generator), "other": x}

    def draw_latents(self, n: int) -> Tensor:
        raise NotImplementedError

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        raise NotImplementedError

    def reset(self, env_ids: Tensor) -> None:
        raise NotImplementedError

    def update(self, rollout: Rollout) -> dict[str, float]:
        raise AssertionError("a low-level agent is frozen")

    def state_dict(self) -> dict[str, Any]:
        raise NotImplementedError

    def load_state_dict(self, state: dict[str, Any]) -> None:
        raise NotImplementedError


def small_task(**changes: Any) -> TaskAgentConfig:
    """A task agent with networks and steps that fit the toy."""
    return TaskAgentConfig(**{"ppo": small_ase().ppo, **changes})


def make_task(env: VectorEnv, generator: torch.Generator, **changes: Any) -> TaskAgent:
    return TaskAgent(env, small_task(**changes), generator)


def make_commanded(env: VectorEnv, generator: torch.Generator, **changes: Any) -> TaskAgent:
    """It sees the skill too."""
    return make_task(env, generator, skill=True, **changes)


def make_hybrid(env: VectorEnv, generator: torch.Generator, **changes: Any) -> TaskAgent:
    return hybrid_agent(env, HybridConfig(**{"ppo": small_ase().ppo, **changes}), generator)
