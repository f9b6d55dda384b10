"""A memory of what the agent did long ago, so that the discriminator does not forget it."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.ranks import ALONE, Part, Ranks

_OWNER = "owner"
"""In a checkpoint of several ranks, the field that says who held each row."""


class Replay:
    """Rows of named fields: filled up first, then each newcomer replaces an old row with a small probability.

    Memory is allocated once, at the first rows; a window of 10 states of 120 takes 4.8 kB. Ranks share one replay: all
    know which rows enter it and where, and each holds its own.
    """

    def __init__(self, capacity: int, keep: float = 0.01, ranks: Ranks = ALONE) -> None:
        """
        Args:
            capacity: rows that it holds (ASE's code: 200,000).
            keep: probability that a row enters once it is full (ASE's code: 0.01).
            ranks: who share it.
        """
        if capacity < 1 or not 0 <= keep <= 1:
            raise AgentError(f"replay: capacity {capacity} must be at least 1 and keep {keep} within [0, 1]")
        self.capacity = capacity
        self.keep = keep
        self.ranks = ranks
        self.count = 0
        self._cursor = 0
        self._fields: dict[str, Tensor] = {}
        self._own = torch.zeros(capacity if ranks.size > 1 else 0, dtype=torch.bool)

    def __len__(self) -> int:
        return self.count

    def add(self, rows: Mapping[str, Tensor], generator: torch.Generator, part: Part | None = None) -> None:
        """Offer rows, `[n, ...]` a field; `part` says which of all ranks' they are."""
        part = part or Part(self.ranks, len(next(iter(rows.values()))))
        n = part.total
        filling = min(n, self.capacity - self.count)
        kept = filling + (torch.rand(n - filling, generator=generator) < self.keep).nonzero().flatten()
        chosen = torch.cat([torch.arange(filling), kept])[-self.capacity :]
        entering = len(chosen)
        slots = (self._cursor + torch.arange(entering)) % self.capacity
        if self.ranks.size > 1:
            self._own[slots] = False
            chosen, entered = part.among(chosen)
            slots = slots[entered.place] if entered.weight else slots[:0]
            chosen = chosen[: len(slots)]
            self._own[slots] = True
        for name, value in rows.items():
            if name not in self._fields:
                self._fields[name] = torch.zeros(self.capacity, *value.shape[1:], dtype=value.dtype)
            self._fields[name][slots] = value[chosen]
        self._cursor = (self._cursor + entering) % self.capacity
        self.count = min(self.count + entering, self.capacity)

    def sample(self, n: int, generator: torch.Generator) -> tuple[dict[str, Tensor], Part]:
        """Of `n` rows of all ranks, drawn with replacement, this rank's, and which they are."""
        rows = torch.randint(self.count, (n,), generator=generator)
        part = Part(self.ranks, n)
        if self.ranks.size > 1:
            part = self.ranks.part(n, self._own[rows].nonzero().flatten())
            rows = part.of(rows)
        return {name: value.index_select(0, rows) for name, value in self._fields.items()}, part

    def state_dict(self) -> dict[str, Any]:
        """The whole replay; all ranks must ask for it."""
        fields = {name: value[: self.count] for name, value in self._fields.items()}
        if self.ranks.size > 1:
            place = self._own[: self.count].nonzero().flatten()
            held = Part(self.ranks, self.count, place)
            fields = {name: held.whole(value[place]) for name, value in fields.items()}
            fields[_OWNER] = held.whole(torch.full((len(place),), self.ranks.rank))
        shared = {"ranks": self.ranks.size} if self.ranks.size > 1 else {}
        return {"fields": fields, "capacity": self.capacity, "count": self.count, "cursor": self._cursor, **shared}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        if state["capacity"] != self.capacity:
            raise AgentError(f"replay: the checkpoint's capacity is {state['capacity']}, the config's {self.capacity}")
        self.count, self._cursor = state["count"], state["cursor"]
        fields = dict(state["fields"])
        owner = fields.pop(_OWNER, None)
        if self.ranks.size > 1:
            if state.get("ranks") != self.ranks.size:  # dealt out anew
                owner = torch.arange(self.count) % self.ranks.size
            self._own[: self.count] = owner == self.ranks.rank
        self._fields = {}
        for name, value in fields.items():
            self._fields[name] = torch.zeros(self.capacity, *value.shape[1:], dtype=value.dtype)
            self._fields[name][: self.count] = value
