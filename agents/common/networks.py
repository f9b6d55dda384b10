"""The networks that every agent builds from: fully connected layers, a Gaussian policy and its critic."""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.losses import action_bound_loss, gaussian_entropy, gaussian_log_prob
from murmillo.agents.common.ranks import ALONE, Ranks


def linear(inputs: int, outputs: int, generator: torch.Generator, bound: float | None = None) -> nn.Linear:
    """A layer with weights ~ U(-bound, bound), PyTorch's own 1 / sqrt(inputs) unless given, and zero biases."""
    layer = nn.Linear(inputs, outputs)
    bound = 1 / math.sqrt(inputs) if bound is None else bound
    nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
    nn.init.zeros_(layer.bias)
    return layer


class Dropout(nn.Module):
    """In training mode hides each element with probability `rate` and scales up the others (Srivastava et al. 2014).

    PyTorch's own draws from the global generator, whose state no checkpoint of ours keeps. Each rank draws for its own
    rows only, since nothing else is drawn so much: several ranks hide other elements than a single process does.
    """

    def __init__(self, rate: float, generator: torch.Generator, ranks: Ranks = ALONE) -> None:
        super().__init__()
        if not 0 <= rate < 1:
            raise AgentError(f"dropout={rate} is no probability below 1; C·ASE has 0.2, and 0 leaves it out")
        self.rate = rate
        self.generator = generator
        self.ranks = ranks

    def forward(self, x: Tensor) -> Tensor:
        if not self.training or self.rate == 0:
            return x
        kept = torch.empty_like(x).bernoulli_(1 - self.rate, generator=self.ranks.fork(self.generator))
        return x * kept / (1 - self.rate)


class Rectifier(nn.Module):
    """A ReLU whose slope, 0 or 1, is a constant to whoever differentiates a gradient.

    PyTorch's own has a second derivative of zeros, which the gradient of a gradient penalty carries back through every
    layer below. Values and gradients are the same.
    """

    def forward(self, x: Tensor) -> Tensor:
        return _Rectified.apply(x)  # type: ignore[return-value]


class _Rectified(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        y = x.clamp_min(0.0)
        ctx.save_for_backward(y)
        return y

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:  # type: ignore[override]
        (y,) = ctx.saved_tensors
        return torch.ops.aten.threshold_backward(gradient, y.detach(), 0.0)


def mlp(
    sizes: Sequence[int],
    generator: torch.Generator,
    dropout: float = 0.0,
    activation: Callable[[], nn.Module] = nn.ReLU,
    ranks: Ranks = ALONE,
) -> nn.Sequential:
    """Layers of the given sizes, the input's first, with a ReLU after every one and dropout, if any, before it."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [Dropout(dropout, generator, ranks)] if dropout else []
        layers += [linear(inputs, outputs, generator), activation()]
    return nn.Sequential(*layers)


def style_mlp(latent_dim: int, hidden: Sequence[int], generator: torch.Generator) -> nn.Sequential:
    """The released code's map of a latent before the policy sees it: hidden ReLU layers, then tanh back to its size."""
    sizes = [latent_dim, *hidden]
    return nn.Sequential(mlp(sizes, generator), linear(sizes[-1], latent_dim, generator, bound=1.0), nn.Tanh())


CONDITION = "condition"
"""The name of the condition where policy and critic are told several things."""

REACH = "reach"
"""The name of how far a policy's means reach, where they are scaled."""

Told = Tensor | Mapping[str, Tensor] | None
"""What policy and critic are told beside the state: a condition `[..., C]`, several things by name, or nothing."""


def by_name(told: Told) -> Mapping[str, Tensor]:
    """What is told, by name; a condition alone has the name `CONDITION`."""
    if told is None:
        return {}
    return {CONDITION: told} if isinstance(told, Tensor) else told


class Policy(nn.Module):
    """A distribution over actions, in three parts that an adapter can get between: a latent, layers, a reading.

    PPO knows a policy by the parameters of its distribution: `forward` gives them, the other methods are told them.
    Here it is a Gaussian, of whose parameters `moments` makes mean and standard deviation; a policy of another kind of
    action overrides what it does with them.
    """

    trunk: nn.Sequential
    """Fully connected layers and what follows each, from Z^0 to the last hidden layer."""
    head: nn.Linear
    """From the last hidden layer to the mean."""
    log_std: Tensor
    """`[A]`, where it depends on no state."""

    def forward(self, state: Tensor, told: Told = None) -> Tensor:
        """Parameters `[..., P]` of the actions in normalised states `[..., D]`, under what the policy is told.

        That may be how far the means reach, `REACH` `[..., A]`, where they are all the parameters.
        """
        parameters, reach = self.read(self.features(state, told)), by_name(told).get(REACH)
        return parameters if reach is None else parameters * reach

    def features(self, state: Tensor, told: Told = None) -> Tensor:
        """The last hidden layer `[..., H]`."""
        return self.trunk(self.encode(state, told))

    def encode(self, state: Tensor, told: Told = None) -> Tensor:
        """Z^0 `[..., Z]`, what the first fully connected layer sees."""
        raise NotImplementedError

    def read(self, features: Tensor) -> Tensor:
        """Parameters `[..., P]` from the last hidden layer `[..., H]`."""
        return self.head(features)

    def copy_encoder(self) -> nn.Module:
        """A module that does as `encode` does now, with weights of its own."""
        raise NotImplementedError

    def moments(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        """Mean `[..., A]` and logarithm of the standard deviation, `[..., A]` or `[A]`."""
        return parameters, self.log_std

    def sample(self, parameters: Tensor, noise: ActionNoise) -> Tensor:
        """Actions `[N, A]` drawn from the distributions with these parameters `[N, P]`."""
        mean, log_std = self.moments(parameters)
        return mean + log_std.exp() * noise.step(*mean.shape)

    def mode(self, parameters: Tensor) -> Tensor:
        """The likeliest actions `[..., A]`."""
        return self.moments(parameters)[0]

    def log_prob(self, action: Tensor, parameters: Tensor) -> Tensor:
        """Log probabilities `[...]` of actions `[..., A]`."""
        return gaussian_log_prob(action, *self.moments(parameters))

    def entropy(self, parameters: Tensor) -> Tensor:
        """[nat], `[...]`, or one for all where it depends on no state."""
        return gaussian_entropy(self.moments(parameters)[1])

    def bound_loss(self, parameters: Tensor) -> Tensor:
        """What keeps the means of parameters `[B, ...]` within [-1, 1]."""
        return action_bound_loss(self.moments(parameters)[0])


class GaussianPolicy(Policy):
    """pi(a | s, c) = N(mu(s, c), diag std^2), with a fixed std (ASE, section 8.2) unless it is learned."""

    def __init__(
        self,
        state_dim: int,
        action_dim: int,
        hidden: Sequence[int],
        std: float,
        generator: torch.Generator,
        *,
        condition_dim: int = 0,
        style_hidden: Sequence[int] = (),
        mean_init_scale: float = 1.0,
        learn_std: bool = False,
        activation: Callable[[], nn.Module] = nn.ReLU,
    ) -> None:
        """
        Args:
            state_dim: D.
            action_dim: A.
            hidden: sizes of the hidden layers.
            std: standard deviation of every action dimension, in units of the action.
            generator: draws the initial weights.
            condition_dim: C, size of the latent or label beside the state; 0 for none.
            style_hidden: hidden sizes of the style network in front of the condition; empty for none.
            mean_init_scale: factor on the initial weights of the last layer.
            learn_std: whether `std` is only where it begins, and is learned for each action dimension.
            activation: after every hidden layer.
        """
        super().__init__()
        self.style = style_mlp(condition_dim, style_hidden, generator) if style_hidden else nn.Identity()
        self.trunk = mlp([state_dim + condition_dim, *hidden], generator, activation=activation)
        self.head = linear(hidden[-1], action_dim, generator)
        with torch.no_grad():
            self.head.weight *= mean_init_scale
        log_std = torch.full((action_dim,), std).log()
        if learn_std:
            self.log_std = nn.Parameter(log_std)
        else:
            self.register_buffer("log_std", log_std)

    def encode(self, state: Tensor, told: Told = None) -> Tensor:
        """The state, and beside it the condition as the style network shows it."""
        return styled(state, told, self.style)

    def copy_encoder(self) -> nn.Module:
        return StyledState(copy.deepcopy(self.style))


def styled(state: Tensor, told: Told, style: nn.Module) -> Tensor:
    """States `[..., D]` and beside each its condition `[..., C]`, if any, as the style network shows it."""
    condition = by_name(told).get(CONDITION)
    return state if condition is None else torch.cat([state, style(condition)], -1)


class StyledState(nn.Module):
    """`styled` with a network of its own."""

    def __init__(self, style: nn.Module) -> None:
        super().__init__()
        self.style = style

    def forward(self, state: Tensor, told: Told = None) -> Tensor:
        return styled(state, told, self.style)


class Critic(nn.Sequential):
    """The expected return of a state under a condition, normalised."""

    def __init__(self, state_dim: int, condition_dim: int, hidden: Sequence[int], generator: torch.Generator) -> None:
        super().__init__(mlp([state_dim + condition_dim, *hidden], generator), linear(hidden[-1], 1, generator))

    def forward(self, state: Tensor, told: Told = None) -> Tensor:
        """`[...]` from normalised states `[..., D]` and the condition `[..., C]` that it is told."""
        condition = by_name(told).get(CONDITION)
        inputs = state if condition is None else torch.cat([state, condition], -1)
        return super().forward(inputs).squeeze(-1)
