"""Adapts a trained policy to something new without touching its weights (AdaptNet, Xu et al. 2023b).

An adapter shifts the latents of the policy and adds to its hidden layers. Both are zero at first, so that adapting
begins with exactly what the policy does.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import Policy, Told
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.ranks import ALONE, Ranks

INJECTION = "injection"
"""What a policy is told under this name is taken for its first adapter's injection, not computed anew."""


@dataclass
class AdapterConfig:
    """What an adapter changes. Defaults: AdaptNet's own; the ablations of its section 9 are other values.

    Attributes:
        injection: latent spaces that are shifted: 0 is the one before the first fully connected layer, i the i-th
            layer's output before its activation; empty for none ("IA").
        own_encoder: the shift is computed from a copy of the policy's encoder that learns, not from what that says.
        internal: add to what the hidden layers give ("LSA" is without).
        rank: of these additions (LoRA); 0 for full rank.
    """

    injection: tuple[int, ...] = (0,)
    own_encoder: bool = True
    internal: bool = True
    rank: int = 0

    def __post_init__(self) -> None:
        if not self.injection and not self.internal:
            raise AgentError("agent.adapter: with injection=[] and internal=false there is nothing to adapt with")
        if self.rank < 0:
            raise AgentError(f"agent.adapter.rank={self.rank}: 0 is full rank, 8 and 64 the paper's low ones")


class Adapter(nn.Module):
    """What is learnt to adapt one policy: I of eq. 5 and F_eta of eq. 7."""

    def __init__(
        self,
        base: Policy,
        config: AdapterConfig,
        generator: torch.Generator,
        control: nn.Module | None = None,
        control_dim: int = 0,
    ) -> None:
        """
        Args:
            base: the policy; only its shapes and its encoder's weights are taken.
            config: what to change.
            generator: draws the initial weights of low rank.
            control: G, from what the policy is told to features `[..., control_dim]` of a new input.
            control_dim: its outputs.

        Raises:
            AgentError: the policy has no such latent space.
        """
        super().__init__()
        layers = linear_layers(base)
        spaces = [layers[0].in_features, *(layer.out_features for layer in layers)]
        self.spaces = tuple(sorted(set(config.injection)))
        if not set(self.spaces) <= set(range(len(spaces))):
            raise AgentError(
                f"agent.adapter.injection={list(config.injection)}: the policy has the latent spaces 0 to {len(layers)}"
            )
        self.sizes = [spaces[i] for i in self.spaces]
        self.encoder = base.copy_encoder() if self.spaces and config.own_encoder else None
        self.control = control if self.spaces else None
        self.embed = _zero(nn.Linear(spaces[0] + control_dim, sum(self.sizes))) if self.spaces else None
        self.internal = config.internal
        shapes = pairwise(spaces) if config.internal else ()
        adaptors = [_adaptor(*shape, config.rank, generator) for shape in shapes]
        self.adaptors = cast("list[nn.Linear | LowRank]", nn.ModuleList(adaptors))

    def injection(self, state: Tensor, told: Told, latent: Tensor | None) -> Tensor:
        """I(s, c), what is added to the latents of all spaces that are shifted, side by side `[..., sum Z^i]`.

        Args:
            state: normalised for this adapter `[..., D]`.
            told: as the policy is told.
            latent: Z^0 as the policy's own encoder has it `[..., Z]`; not asked for where the adapter has its own.
        """
        assert self.embed is not None
        encoded = latent if self.encoder is None else self.encoder(state, told)
        assert encoded is not None
        return self.embed(encoded if self.control is None else torch.cat([encoded, self.control(told)], -1))

    def split(self, injection: Tensor) -> dict[int, Tensor]:
        """The injection `[..., sum Z^i]` by latent space."""
        return dict(zip(self.spaces, injection.split(self.sizes, -1), strict=True))

    def size(self) -> Tensor:
        """||eta||^2, of the additions to the hidden layers."""
        squares = [parameter.square().sum() for adaptor in self.adaptors for parameter in adaptor.parameters()]
        return torch.stack(squares).sum() if squares else torch.zeros(())


class AdaptedPolicy(Policy):
    """A frozen policy and adapters of it, each with a strength (eqs. 13 and 14).

    Its states are views: the state as the policy's own normaliser shows it and, beside it, as each adapter's does
    (`Views`).
    """

    def __init__(self, base: Policy, *adapters: Adapter) -> None:
        """`base` is frozen here, for good."""
        super().__init__()
        self.base = base.requires_grad_(False)
        self.adapters = cast("list[Adapter]", nn.ModuleList(adapters))
        self.strengths = [1.0] * len(adapters)

    def blend(self, alpha: float) -> None:
        """Set the strength of the one adapter, or alpha and 1 - alpha of two; at any time, also while walking.

        Raises:
            AgentError: alpha is not in [0, 1].
        """
        if not 0 <= alpha <= 1:
            raise AgentError(f"alpha={alpha}: 0 is without the adapter, 1 with all of it; name a number between")
        self.strengths = [alpha, 1 - alpha][: len(self.adapters)]

    def join(self, adapter: Adapter) -> None:
        """Add a second adapter of the same policy; both act with half their strength until they are blended.

        Raises:
            AgentError: there are two already.
        """
        if len(self.adapters) != 1:
            raise AgentError("a policy blends two adapters at most")
        self.adapters.append(adapter)
        self.blend(0.5)

    def injection(self, state: Tensor, told: Told = None) -> Tensor:
        """The first adapter's injection `[..., sum Z^i]` at full strength, for its penalty."""
        adapter, view = self.adapters[0], self._views(state)[1]
        return adapter.injection(view, told, None if adapter.encoder else self.own_latent(state, told))

    def own_latent(self, state: Tensor, told: Told = None) -> Tensor:
        """Z^0 as the frozen policy alone has it."""
        return self.base.encode(self._views(state)[0], told)

    def encode(self, state: Tensor, told: Told = None) -> Tensor:
        """Z^0 with what the adapters add to it (eq. 4)."""
        latent = self.own_latent(state, told)
        return latent + self._shifts(state, told, latent).get(0, 0.0)

    def features(self, state: Tensor, told: Told = None) -> Tensor:
        """The last hidden layer, by eqs. 4 and 7."""
        latent = self.own_latent(state, told)
        shifts = self._shifts(state, told, latent)
        z, space = latent + shifts.get(0, 0.0), 0
        for layer in self.base.trunk:
            if isinstance(layer, nn.Linear):
                added, space = self._added(space, z), space + 1
                z = layer(z) + added + shifts.get(space, 0.0)
            else:
                z = layer(z)
        return z

    def _views(self, state: Tensor) -> tuple[Tensor, ...]:
        """The state as the policy and as each adapter is shown it."""
        return state.chunk(1 + len(self.adapters), -1)

    def _shifts(self, state: Tensor, told: Told, latent: Tensor) -> dict[int, Tensor | float]:
        """What all adapters together add to each latent space that they shift."""
        shifts: dict[int, Tensor | float] = {}
        known = told.get(INJECTION) if isinstance(told, Mapping) else None
        for adapter, view, strength in zip(self.adapters, self._views(state)[1:], self.strengths, strict=True):
            if adapter.spaces:
                injection = adapter.injection(view, told, latent) if known is None else known
                for space, part in adapter.split(injection).items():
                    shifts[space] = shifts.get(space, 0.0) + strength * part
            known = None  # it is the first one's
        return shifts

    def _added(self, number: int, z: Tensor) -> Tensor | float:
        """What all adapters together add to the output of a hidden layer for its input `[..., Z]`."""
        added: Tensor | float = 0.0
        for adapter, strength in zip(self.adapters, self.strengths, strict=True):
            if adapter.internal:
                added = added + strength * adapter.adaptors[number](z)
        return added

    def read(self, features: Tensor) -> Tensor:
        """The heads are not adapted."""
        return self.base.read(features)

    def moments(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        return self.base.moments(parameters)


class Views(nn.Module):
    """A state as several normalisers show it, side by side: the frozen policy's first, then each adapter's.

    An adapter's normaliser begins as a copy of the policy's that has seen one sample only, so that it soon tells of the
    new states, while the policy's own stays as it was trained with.
    """

    def __init__(self, *normalizers: RunningNormalizer) -> None:
        super().__init__()
        self.normalizers = cast("list[RunningNormalizer]", nn.ModuleList(normalizers))

    @classmethod
    def of(cls, normalizer: RunningNormalizer) -> "Views":
        """Of a trained policy's normaliser, which is frozen here for good, and of one adapter."""
        learning = copy.deepcopy(normalizer)
        learning.frozen.fill_(False)
        learning.count.fill_(1.0)  # released code
        normalizer.freeze()
        return cls(normalizer, learning)

    def forward(self, state: Tensor) -> Tensor:
        """`[..., V D]` from raw states `[..., D]`."""
        return torch.cat([normalizer(state) for normalizer in self.normalizers], -1)

    def update(self, batch: Tensor, *, ranks: Ranks = ALONE) -> None:
        """Take in raw states `[..., D]`, in all views that are not frozen."""
        for normalizer in self.normalizers:
            normalizer.update(batch, ranks=ranks)


def linear_layers(policy: Policy) -> list[nn.Linear]:
    """The fully connected layers between the latent spaces."""
    return [layer for layer in policy.trunk if isinstance(layer, nn.Linear)]


class LowRank(nn.Module):
    """A layer of low rank, zero at first (LoRA, Hu et al. 2021)."""

    def __init__(self, inputs: int, outputs: int, rank: int, generator: torch.Generator) -> None:
        super().__init__()
        self.down = nn.Linear(inputs, rank, bias=False)
        nn.init.uniform_(self.down.weight, -(inputs**-0.5), inputs**-0.5, generator=generator)
        self.up = _zero(nn.Linear(rank, outputs))

    def forward(self, z: Tensor) -> Tensor:
        return self.up(self.down(z))


def affine(adaptor: nn.Linear | LowRank) -> tuple[Tensor, Tensor]:
    """Weight and bias of an adaptor of any rank, as one layer's."""
    if isinstance(adaptor, nn.Linear):
        return adaptor.weight, adaptor.bias
    return adaptor.up.weight @ adaptor.down.weight, adaptor.up.bias


def _adaptor(inputs: int, outputs: int, rank: int, generator: torch.Generator) -> nn.Linear | LowRank:
    if rank > min(inputs, outputs):
        raise AgentError(f"agent.adapter.rank={rank}: a layer has rank {min(inputs, outputs)} at most; 0 is full rank")
    return LowRank(inputs, outputs, rank, generator) if rank else _zero(nn.Linear(inputs, outputs))


def _zero(layer: nn.Linear) -> nn.Linear:
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer
