"""A memory of what the agent did long ago, so that the discriminator does not forget it."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.errors import AgentError


class Replay:
    """Rows of named fields: filled up first, then each newcomer replaces an old row with a small probability.

    Memory is allocated once, at the first rows; a window of 10 states of 120 takes 4.8 kB.
    """

    def __init__(self, capacity: int, keep: float = 0.01) -> None:
        """
        Args:
            capacity: rows that it holds (ASE's code: 200,000).
            keep: probability that a row enters once it is full (ASE's code: 0.01).
        """
        if capacity < 1 or not 0 <= keep <= 1:
            raise AgentError(f"replay: capacity {capacity} must be at least 1 and keep {keep} within [0, 1]")
        self.capacity = capacity
        self.keep = keep
        self.count = 0
        self._cursor = 0
        self._fields: dict[str, Tensor] = {}

    def __len__(self) -> int:
        return self.count

    def add(self, rows: Mapping[str, Tensor], generator: torch.Generator) -> None:
        """Offer rows, `[n, ...]` a field."""
        n = len(next(iter(rows.values())))
        filling = min(n, self.capacity - self.count)
        kept = filling + (torch.rand(n - filling, generator=generator) < self.keep).nonzero().flatten()
        chosen = torch.cat([torch.arange(filling), kept])[-self.capacity :]
        slots = (self._cursor + torch.arange(len(chosen))) % self.capacity
        for name, value in rows.items():
            if name not in self._fields:
                self._fields[name] = torch.empty(self.capacity, *value.shape[1:], dtype=value.dtype)
            self._fields[name][slots] = value[chosen]
        self._cursor = (self._cursor + len(chosen)) % self.capacity
        self.count = min(self.count + len(chosen), self.capacity)

    def sample(self, n: int, generator: torch.Generator) -> dict[str, Tensor]:
        """`n` rows, drawn with replacement."""
        rows = torch.randint(self.count, (n,), generator=generator)
        return {name: value[rows] for name, value in self._fields.items()}

    def state_dict(self) -> dict[str, Any]:
        fields = {name: value[: self.count] for name, value in self._fields.items()}
        return {"fields": fields, "capacity": self.capacity, "count": self.count, "cursor": self._cursor}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        if state["capacity"] != self.capacity:
            raise AgentError(f"replay: the checkpoint's capacity is {state['capacity']}, the config's {self.capacity}")
        self.count, self._cursor = state["count"], state["cursor"]
        self._fields = {}
        for name, value in state["fields"].items():
            self._fields[name] = torch.empty(self.capacity, *value.shape[1:], dtype=value.dtype)
            self._fields[name][: self.count] = value
