"""Which skill each world is commanded: drawn at random, or as a user or an agent directs."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.envs.errors import SuiteError


class CommandedSkills:
    """The commanded labels of N worlds.

    Attributes:
        names: of the K labels.
        current: [N] int64 indices into `names`; replaced when some are drawn anew.
    """

    def __init__(self, names: tuple[str, ...], num_envs: int) -> None:
        self.names = names
        self.current = torch.zeros(num_envs, dtype=torch.int64)
        self._weights: Tensor | None = None

    def command(self, skill: str | int, env_ids: Sequence[int] | None = None) -> None:
        """Command a skill, by name or index, in these worlds; None is all."""
        if isinstance(skill, str):
            if skill not in self.names:
                raise SuiteError(f"skill={skill}: no such skill; there are: {', '.join(self.names)}")
            skill = self.names.index(skill)
        if not 0 <= skill < len(self.names):
            raise SuiteError(f"skill={skill}: needs an index below {len(self.names)}, or a name")
        self.current[slice(None) if env_ids is None else list(env_ids)] = skill

    def weigh(self, weights: Tensor | None) -> None:
        """Draw with these probabilities from now on, [K] and not negative; None draws all alike."""
        if weights is not None and weights.shape != (len(self.names),):
            raise SuiteError(f"skill weights of shape {tuple(weights.shape)}: needs one for each of {len(self.names)}")
        if weights is not None and not (bool((weights >= 0).all()) and 0 < weights.sum() < math.inf):
            raise SuiteError(f"skill weights {weights.tolist()}: needs finite ones, none below 0 and not all 0")
        self._weights = weights

    def draw(self, env_ids: Tensor, generator: torch.Generator) -> None:
        """Command others in the worlds env_ids [n]."""
        n = len(env_ids)
        if self._weights is None:
            drawn = torch.randint(len(self.names), (n,), generator=generator)
        else:
            drawn = torch.multinomial(self._weights, n, replacement=True, generator=generator)
        self.put(env_ids, drawn)

    def put(self, env_ids: Tensor, skill: Tensor) -> None:
        """Command these [n] skills in the worlds env_ids [n]."""
        self.current = self.current.index_copy(0, env_ids, skill)
