"""Moving like the clips: the task of low-level training, whose reward comes from the agent's discriminator."""

import torch
from torch import Tensor

from murmillo.envs.physics import State


class Imitation:
    """No goal and no reward: zero by design, under the name `task`. Episodes end by falls and by the clock alone."""

    goal_dim = 0

    def reset(self, env_ids: Tensor, state: State) -> None:
        pass

    def goal(self, state: State) -> Tensor:
        return torch.zeros(len(state.qpos), 0)

    def reward(self, state: State) -> dict[str, Tensor]:
        return {"task": torch.zeros(len(state.qpos))}

    def terminated(self, state: State) -> Tensor:
        return torch.zeros(len(state.qpos), dtype=torch.bool)
