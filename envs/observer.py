"""What N worlds show: their last frames of features, and the observations that are made of them."""

import gymnasium
import numpy as np
import torch
from torch import Tensor

from murmillo.envs.features import Features, Worlds
from murmillo.envs.physics import State
from murmillo.envs.terrain import MAP_SHAPE, Terrain

LIMIT = 1000
"""Observations are cut off here; no sound simulation comes near (a diverging one may, before it is healed)."""


class Observer:
    """Keeps the frames of N worlds from step to step, and what they see of uneven ground.

    Attributes:
        frames: [N, W, D] the last frames of each world, the newest last; replaced at each step, never written to.
        ground: [N] height of the ground under each root [m]; None is level at 0.
    """

    def __init__(self, features: Features, num_envs: int, window: int, terrain: Terrain | None = None) -> None:
        """`window` frames are an observation of their own, if more than 1."""
        self._features, self._window, self._terrain = features, window, terrain
        self.frames = torch.zeros(num_envs, max(window, features.frames), features.frame_dim)
        self.ground = None if terrain is None else torch.zeros(num_envs, dtype=torch.float64)
        self._map = torch.zeros(num_envs, *MAP_SHAPE)

    def spaces(self) -> dict[str, gymnasium.Space]:
        """The space of each observation in one world."""
        shapes = {"state": self._features.state_shape}
        if self._window > 1:
            shapes["window"] = (self._window, self._features.window_dim)
        spaces: dict[str, gymnasium.Space] = {name: box(shape) for name, shape in shapes.items()}
        if self._features.frames > 1:
            spaces["length"] = gymnasium.spaces.Discrete(self._features.frames, start=1)
        if self._terrain is not None:
            spaces["heights"] = box(MAP_SHAPE)
        return spaces

    def see(self, state: State) -> None:
        """A step has led to this state."""
        self._look(state)
        self.frames = torch.cat((self.frames[:, 1:], self._newest(state).unsqueeze(1)), dim=1)

    def begin(self, state: State, worlds: Tensor, recorded: Tensor, before: Tensor) -> None:
        """Episodes begin in the worlds [n]: in those of recorded [r] after the frames before [r, W - 1, D].

        In the others the first frame is repeated.
        """
        self._look(state, worlds)
        frames = self.frames.clone()
        frames[worlds] = self._newest(state, worlds).unsqueeze(1)
        frames[recorded, :-1] = before
        self.frames = frames

    def load(self, state: State, frames: Tensor) -> None:
        """Continue from these frames in this state."""
        self.frames = frames.clone()
        self._look(state)

    def observation(self, steps: Tensor) -> dict[str, Tensor]:
        """The observations of all worlds, steps [N] after their episodes' begin."""
        seen = self._features.state(self.frames[:, -self._features.frames :], steps + 1, self.ground)
        if self._window > 1:
            seen["window"] = self._features.window(self.frames[:, -self._window :], self.ground)
        if self._terrain is not None:
            seen["heights"] = self._map
        return {name: value.clamp(-LIMIT, LIMIT) for name, value in seen.items()}

    def _newest(self, state: State, worlds: Worlds = slice(None)) -> Tensor:
        ground = None if self.ground is None else self.ground[worlds]
        return self._features.simulated(state, worlds, ground)

    def _look(self, state: State, worlds: Worlds = slice(None)) -> None:
        """See the ground about the roots of these worlds."""
        if self._terrain is None or self.ground is None:
            return
        root_w = state.qpos[worlds, :7].nan_to_num()
        self.ground, self._map = self.ground.clone(), self._map.clone()
        self.ground[worlds] = self._terrain.height(root_w)
        self._map[worlds] = self._terrain.map(root_w[:, :3], root_w[:, 3:])


def box(shape: tuple[int, ...]) -> gymnasium.spaces.Box:
    """The space of observations of this shape."""
    return gymnasium.spaces.Box(-LIMIT, LIMIT, shape, np.float32)
