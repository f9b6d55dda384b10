"""One world as a plain gymnasium environment."""

import dataclasses
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np

from murmillo.envs.config import EnvConfig
from murmillo.envs.tasks import Task
from murmillo.envs.vector import HumanoidVectorEnv


class HumanoidEnv(gymnasium.Env):
    """`HumanoidVectorEnv` with one world and no autoreset; observations, actions and info lose their first axis."""

    metadata: ClassVar[dict[str, Any]] = HumanoidVectorEnv.metadata

    def __init__(
        self,
        config: EnvConfig | None = None,
        task: Task | None = None,
        render_mode: Literal["rgb_array", "human"] | None = None,
    ) -> None:
        config = dataclasses.replace(config or EnvConfig(threads=1), autoreset="disabled", tensors=False)
        self.vector = HumanoidVectorEnv(1, config, task, render_mode)
        self.render_mode = render_mode
        self.observation_space = self.vector.single_observation_space
        self.action_space = self.vector.single_action_space

    @property
    def skills(self) -> tuple[str, ...]:
        """Names of the labels that `skill` counts."""
        return self.vector.skills

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        super().reset(seed=seed)
        obs, info = self.vector.reset(seed=seed, options=options)
        return _first(obs), _first(info)

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        obs, reward, terminated, truncated, info = self.vector.step(np.asarray(action)[None])
        return _first(obs), float(reward[0]), bool(terminated[0]), bool(truncated[0]), _first(info)

    def set_skill(self, skill: str | int) -> None:
        """Command a skill, by name or index, from the next step on."""
        self.vector.set_skill(skill)

    def render(self) -> np.ndarray | None:
        frames = self.vector.render()
        return None if frames is None else frames[0]

    def close(self) -> None:
        self.vector.close()


def _first(batched: Any) -> Any:
    """World 0 of a nested dict of arrays."""
    if isinstance(batched, dict):
        return {name: _first(value) for name, value in batched.items()}
    return batched[0].item() if batched[0].dtype == bool else batched[0]
