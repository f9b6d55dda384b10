"""The policy that is adapted: its weights, what it was normalised by, and what else gives its conditions a meaning."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

from murmillo.agents.common import checkpoint
from murmillo.agents.common.adaptation import frozen
from murmillo.agents.common.adapter import AdaptedPolicy, Adapter, Views
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.merging import MergedPolicy, Shape
from murmillo.agents.common.networks import Policy
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.training import load_module

P = TypeVar("P", bound=Policy)

EYE = "eye"
"""Under this name an adaptation keeps the base's discriminator, in whose units an encoder of skills sees motion."""

MERGED = "merged"
"""Under this name the state of an agent has the `Shape` of its policy, where that was merged."""

_POLICY, _NORMALIZER = "policy.", "state_normalizer."
_WITHIN = (f"{_POLICY}base.", f"{_NORMALIZER}normalizers.0.")
"""Where an adapted policy has the two."""
_PLAIN = f"{_POLICY}plain."
"""Where a merged one has the policy of the base's kind."""
_PER_ACTION = ("head.weight", "head.bias", "spread.weight", "spread.bias", "log_std")
"""The tensors with a row for each action."""


@dataclass(frozen=True)
class Base:
    """What is taken over from a trained policy.

    Attributes:
        policy: its weights by name.
        normalizer: the statistics of its states.
        parts: states of its agent's other parts by name, an encoder and the like.
        merged: what stands side by side in it where it was merged with adapters; such a policy is no base any more.
    """

    policy: Mapping[str, Tensor]
    normalizer: Mapping[str, Tensor]
    parts: Mapping[str, Any] = field(default_factory=dict)
    merged: Shape | None = None

    @classmethod
    def of(cls, model: Mapping[str, Tensor], parts: Mapping[str, Any] | None = None) -> "Base":
        """From the state of a model that was trained from nothing, or finetuned, and its agent's other parts.

        Raises:
            AgentError: it holds an adapted policy.
        """
        policy, normalizer = _under(_POLICY, model), _under(_NORMALIZER, model)
        if "head.weight" not in policy or "mean" not in normalizer:
            raise AgentError("base: this is no policy that was trained from nothing; adapters need one")
        return cls(policy, normalizer, parts or {})

    @classmethod
    def load(cls, folder: Path | str) -> "Base":
        """From the checkpoint of such a run.

        Raises:
            AgentError: it is damaged, or holds no such policy.
        """
        agent = checkpoint.load(folder).get("agent")
        if (model := _model(agent)) is None:
            raise AgentError(f"base: {folder} holds no policy that can be adapted")
        return cls.of(model, agent)

    @classmethod
    def within(cls, agent: Mapping[str, Any]) -> "Base | None":
        """The base that the state of an adaptation has in it; None where an agent adapts none.

        Where it was merged, what an agent is made of that can take in this state.
        """
        found = cls.beneath(_model(agent) or {})
        if "mean" not in found.normalizer:
            return None
        found = replace(found, parts={**agent, "discriminator": agent.get(EYE)})
        if MERGED not in agent:
            return found
        return replace(found, policy=_under(_PLAIN, _model(agent) or {}), merged=Shape.load(agent[MERGED]))

    @classmethod
    def beneath(cls, model: Mapping[str, Tensor]) -> "Base":
        """What stays frozen in the state of an adapted model."""
        policy, normalizer = (_under(prefix, model) for prefix in _WITHIN)
        return cls(policy, normalizer)

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
        return replace(self, policy=policy)

    def adapted(self, plain: Policy, state_dim: int, adapter: Callable[[Policy], Adapter]) -> tuple[Policy, Views]:
        """A policy of the same kind with these weights and an adapter, and the views that it is shown of states `[D]`.

        Where this was merged, a policy and views of that shape, to take in their weights with a checkpoint.

        Args:
            plain: of the base's kind.
            state_dim: D.
            adapter: makes one for the policy.

        Raises:
            AgentError: the policy has other layers or actions.
        """
        if self.merged is not None:
            views = Views(*(RunningNormalizer((state_dim,)) for _ in range(self.merged.views)))
            return MergedPolicy(plain, self.merged), views
        own, views = self.adopt(plain, state_dim)
        return AdaptedPolicy(own, adapter(own)), views

    def adopt(self, policy: P, state_dim: int) -> tuple[P, Views]:
        """Give a policy of the same kind these weights, and show it states `[..., D]` as this one was shown them.

        Returns:
            the policy, and views for it and for one adapter.

        Raises:
            AgentError: it has other layers or actions.
        """
        if self.actions != (actions := policy.head.out_features):
            raise AgentError(
                f"the base acts with {self.actions} numbers, the environment takes {actions}; "
                "prune the outputs of joints that are locked"
            )
        load_module(policy, self.policy, "base policy")
        normalizer = RunningNormalizer((state_dim,))
        load_module(normalizer, self.normalizer, "base's normaliser")
        return policy, Views.of(normalizer)


def take_over(module: nn.Module, base: Base, part: str) -> None:
    """Give a network the weights of that part of the base's agent, and freeze it.

    Raises:
        AgentError: the base has no such part, or one of another size.
    """
    if not isinstance(state := base.parts.get(part), Mapping):
        raise AgentError(f"the base has no {part}: it is another agent's; name one of this agent")
    load_module(module, state, f"{part} of the base")
    frozen(module)


def _under(prefix: str, model: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """What stands in the model under this prefix."""
    return {name.removeprefix(prefix): value for name, value in model.items() if name.startswith(prefix)}


def _model(agent: Any) -> dict[str, Tensor] | None:
    """Policy and critic in the state of an agent."""
    for name in ("ppo", "model"):
        agent = agent.get(name) if isinstance(agent, Mapping) else None
    return agent if isinstance(agent, dict) else None
