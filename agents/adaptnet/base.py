"""The policy that is adapted: its weights and what it was normalised by, known by a digest."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from murmillo.agents.common import checkpoint
from murmillo.agents.common.errors import AgentError

_POLICY, _NORMALIZER = "policy.", "state_normalizer."
_PER_ACTION = ("head.weight", "head.bias", "spread.weight", "spread.bias", "log_std")
"""The tensors with a row for each action."""


@dataclass(frozen=True)
class Base:
    """What is taken over from a trained policy.

    Attributes:
        policy: its weights by name.
        normalizer: the statistics of its states.
    """

    policy: Mapping[str, Tensor]
    normalizer: Mapping[str, Tensor]

    @classmethod
    def of(cls, model: Mapping[str, Tensor]) -> "Base":
        """From the state of a model that was trained from nothing, or finetuned.

        Raises:
            AgentError: it holds an adapted policy.
        """
        policy = {name[len(_POLICY) :]: value for name, value in model.items() if name.startswith(_POLICY)}
        normalizer = {name[len(_NORMALIZER) :]: value for name, value in model.items() if name.startswith(_NORMALIZER)}
        if "spread.weight" not in policy or "mean" not in normalizer:
            raise AgentError("base: this is no policy of AdaptNet that was trained from nothing; adapters need one")
        return cls(policy, normalizer)

    @classmethod
    def load(cls, folder: Path | str) -> "Base":
        """From the checkpoint of such a run.

        Raises:
            AgentError: it is damaged, or holds no such policy.
        """
        model = checkpoint.load(folder)
        for name in ("agent", "ppo", "model"):
            model = model.get(name)
            if not isinstance(model, dict):
                raise AgentError(f"base: {folder} holds no policy of AdaptNet")
        return cls.of(model)

    @property
    def actions(self) -> int:
        """A, the numbers of its actions."""
        return len(self.policy["log_std"])

    @property
    def digest(self) -> str:
        """SHA-256 of all tensors with their names and shapes."""
        sha = hashlib.sha256()
        for part in (self.policy, self.normalizer):
            for name, value in sorted(part.items()):
                sha.update(f"{name}{list(value.shape)}".encode())
                sha.update(value.contiguous().numpy().tobytes())
        return sha.hexdigest()

    def pruned(self, outputs: Sequence[int]) -> "Base":
        """Only these outputs, in this order, for a body with joints locked (section 8.2).

        Raises:
            AgentError: there is no such output, or one is named twice.
        """
        wrong = [output for output in outputs if not 0 <= output < self.actions]
        if wrong:
            raise AgentError(f"base: there is no output {wrong[0]} to keep; the policy has 0 to {self.actions - 1}")
        if not outputs or len(set(outputs)) != len(outputs):
            raise AgentError(f"base: the outputs to keep must be named, each once; they are {list(outputs)}")
        rows = torch.tensor(outputs)
        policy = {name: value[rows] if name in _PER_ACTION else value for name, value in self.policy.items()}
        return Base(policy, self.normalizer)
