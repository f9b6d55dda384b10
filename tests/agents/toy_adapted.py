"""Small agents of ASE, CALM and C·ASE that adapt a base, and their bases."""

from collections.abc import Callable
from typing import Any

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor, nn

from murmillo.agents.ase.agent import ASE
from murmillo.agents.calm.agent import CALM
from murmillo.agents.case.agent import CASE
from murmillo.agents.common.base import Base
from tests.agents.toy import PointMass, small_ase, small_calm, small_case

KINDS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "ase": (ASE, small_ase),
    "calm": (CALM, small_calm),
    "case": (CASE, small_case),
}


def make(kind: str, env: VectorEnv, generator: torch.Generator, base: Base | None = None, **changes: Any) -> Any:
    """A small agent on the toy."""
    cls, config = KINDS[kind]
    return cls(env, env.demonstrations, config(**changes), generator, base)  # type: ignore[attr-defined]


def make_parent(kind: str, skills: int = 3, seed: int = 7, **changes: Any) -> Any:
    """An agent from nothing that knows the scale of states and windows, and acts clearly by state and condition."""
    env, generator = PointMass(16, skills=skills), torch.Generator().manual_seed(seed)
    agent = make(kind, env, generator, **changes)
    agent.model.state_normalizer.update(torch.randn(500, 4, generator=generator) * torch.tensor([1, 2, 3, 4.0]))
    with torch.no_grad():
        agent.model.policy.head.weight *= 5
    return agent


def base_of(agent: Any) -> Base:
    state = agent.state_dict()
    return Base.of(state["ppo"]["model"], state)


def make_adapted(kind: str, env: PointMass, generator: torch.Generator, **changes: Any) -> Any:
    """An adaptation of a base of the same settings."""
    return make(kind, env, generator, base_of(make_parent(kind, env.skills, **changes)), **changes)


def adapted(kind: str) -> Callable[..., Any]:
    """`make_adapted` of this kind, as the other toys are made."""
    return lambda env, generator, **changes: make_adapted(kind, env, generator, **changes)


def shake(agent: Any, scale: float = 0.1, seed: int = 9) -> None:
    """Move all that training would move in the policy."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in agent.model.policy.adapters.parameters():
            parameter += scale * torch.randn(parameter.shape, generator=generator)


def copies(module: nn.Module) -> dict[str, Tensor]:
    """What a network holds now."""
    return {name: value.clone() for name, value in module.state_dict().items()}
