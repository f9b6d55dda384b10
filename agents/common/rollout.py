"""What happened in the worlds since the last update: named fields `[T, N, ...]`."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ranks import ALONE, Part, Ranks


class Rollout:
    """T steps of N worlds as named tensors `[T, N, ...]` of float32, int64 or bool.

    A field is allocated when it is first stored, on the device of its values, and lives on, so that an iteration writes
    where the last one wrote.
    "state", "skill", ... are what the agent saw, "next_state", ... their true successors (`true_next_obs`).

    Attributes:
        horizon: T.
        num_envs: N, this rank's worlds.
        ranks: who have as many each.
        part: which of all ranks' samples, counted step by step and in each step rank by rank, are this one's.
        kept: indices of the rows of `flat` among the T N; None keeps all.
    """

    def __init__(self, horizon: int, num_envs: int, ranks: Ranks = ALONE) -> None:
        self.horizon = horizon
        self.num_envs = num_envs
        self.ranks = ranks
        self._all = Part(ranks, self.samples)
        if ranks.size > 1:
            places = torch.arange(self.samples * ranks.size).view(horizon, -1)
            self._all = ranks.part(places.numel(), ranks.worlds(num_envs).of(places.T).T.flatten())
        self.part = self._all
        self.kept: Tensor | None = None
        self._fields: dict[str, Tensor] = {}

    def store(self, t: int, fields: Mapping[str, Tensor]) -> None:
        """Copy each `[N, ...]` of `fields` into row `t`."""
        for name, value in fields.items():
            if name not in self._fields:
                self._fields[name] = torch.empty(self.horizon, *value.shape, dtype=_kind(value), device=value.device)
            self._fields[name][t] = value

    def __getitem__(self, name: str) -> Tensor:
        """The field `[T, N, ...]`."""
        if name not in self._fields:
            raise KeyError(f"rollout field '{name}'; it has: {', '.join(sorted(self._fields))}")
        return self._fields[name]

    def __setitem__(self, name: str, value: Tensor) -> None:
        if value.shape[:2] != (self.horizon, self.num_envs):
            raise ValueError(f"rollout field '{name}' {tuple(value.shape)} does not begin with [T, N] = {self.shape}")
        self._fields[name] = value

    def __contains__(self, name: str) -> bool:
        return name in self._fields

    @property
    def shape(self) -> tuple[int, int]:
        """(T, N)."""
        return self.horizon, self.num_envs

    @property
    def samples(self) -> int:
        """T N."""
        return self.horizon * self.num_envs

    @property
    def all_samples(self) -> int:
        """T N of all ranks together."""
        return self._all.total

    def leave_out(self, rows: Tensor) -> None:
        """Learn nothing from these steps `[T, N]` bool: `flat` and minibatches lack them. All ranks must call it."""
        self.kept, self.part = None, self._all
        if self.ranks.any(bool(rows.any())):
            self.kept = (~rows).flatten().nonzero().flatten()
            self.part = self.ranks.among(len(self.kept))

    def alike(self) -> "Rollout":
        """An empty rollout of the same steps, with the same ones left out."""
        other = Rollout(self.horizon, self.num_envs, self.ranks)
        other.kept, other.part = self.kept, self.part
        return other

    def flat(self, name: str) -> Tensor:
        """The field `[T N, ...]`, a view where no row is left out."""
        rows = self[name].flatten(0, 1)
        return rows if self.kept is None else rows[self.kept]

    def minibatches(self, size: int, generator: torch.Generator) -> Iterator[tuple[Tensor, Part]]:
        """Every row once, in random order, as `draw` gives them; the last minibatch may be smaller."""
        yield from map(self.part.among, torch.randperm(self.part.total, generator=generator).split(size))

    def draw(self, n: int, generator: torch.Generator) -> tuple[Tensor, Part]:
        """Of n rows of all ranks, drawn with replacement, this rank's: indices into the flat views, and places."""
        return self.part.among(torch.randint(self.part.total, (n,), generator=generator))


def _kind(value: Tensor) -> torch.dtype:
    if value.dtype == torch.bool:
        return torch.bool
    return torch.float32 if value.is_floating_point() else torch.int64


def taken(env: Any, action: Tensor) -> Any:
    """The action as the environment takes it: a tensor where it shows tensors (its `tensors`), else an array."""
    return action if getattr(env, "tensors", False) else action.cpu().numpy()


def tensors(obs: Any) -> dict[str, Tensor]:
    """A vector environment's dict observation as float32 / int64 tensors, which share its memory where they can."""
    if not isinstance(obs, Mapping):
        raise AgentError("the environment's observation is no dict; wrap it so that it gives {'state': [N, D], ...}")
    named = {name: torch.as_tensor(value) for name, value in obs.items()}
    return {name: value.to(_kind(value)) for name, value in named.items()}


def true_next_obs(obs: Any, infos: dict[str, Any]) -> dict[str, Tensor]:
    """The successor of every world's step, also where SAME_STEP autoreset has already begun a new episode.

    Two conventions of `infos["final_obs"]` are known: a dict of arrays `[N, ...]` that holds the true successor of all
    worlds, and Gymnasium's own, an object array `[N]` with a world's dict where the mask `infos["_final_obs"]` is set.

    Args:
        obs: what `step` returned, `[N, ...]` each.
        infos: the infos that `step` returned; without "final_obs" no episode ended.
    """
    final = infos.get("final_obs")
    if final is None:
        return tensors(obs)
    if isinstance(final, Mapping):
        return tensors(final)
    successor = {name: value.clone() for name, value in tensors(obs).items()}
    for world in np.flatnonzero(infos["_final_obs"]):
        for name, value in successor.items():
            value[world] = torch.as_tensor(final[world][name])
    return successor
