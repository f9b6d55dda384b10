"""Does the character move in the style that it is told? The nearest clip of every control step says so."""

import numpy as np
import torch
from torch import Tensor

from murmillo.cli.evaluation.scene import Scene
from murmillo.envs import HumanoidVectorEnv

_PIECE = 64
"""Worlds that are matched at once."""


class StyleSuccess:
    """Tells of each control step whether the clip that is nearest to it, of all clips, has the commanded skill.

    CALM has human raters judge whether the style is the one that was asked for (section 8.2.1); the nearest clip of a
    transition is ASE's eq. 22.

    Attributes:
        skill: `[N]` int64, what the worlds are commanded throughout their first episodes.
    """

    skill: Tensor

    def __init__(self, env: HumanoidVectorEnv) -> None:
        scene = Scene(env.character, env.library, seed=0, labelled=True)
        self._matcher = scene.matcher
        # of clips that are bit for bit the same one stands for all, and for the skills of all
        self._has_skill = torch.zeros(len(scene.states), len(env.skills), dtype=torch.bool)
        self._has_skill[scene.first_alike, env.library.clip_skill] = True

    def begin(self, obs: dict[str, np.ndarray]) -> None:
        """The episodes begin with these observations."""
        self.skill = torch.as_tensor(obs["skill"])
        self._states = [torch.as_tensor(obs["state"])]
        self._right: Tensor | None = None

    def step(self, final_obs: dict[str, np.ndarray]) -> None:
        """A control step has led to these observations, which are those from before any reset."""
        self._states.append(torch.as_tensor(final_obs["state"]))
        self._right = None

    def steps(self) -> Tensor:
        """`[N, T]` bool for all control steps since `begin`; those behind the end of an episode have no meaning."""
        if self._right is None:
            pieces = torch.stack(self._states, 1).split(_PIECE)
            nearest = torch.cat([self._matcher.nearest(piece) for piece in pieces])
            self._right = self._has_skill[nearest, self.skill[:, None]]
        return self._right
