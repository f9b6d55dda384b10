"""Policy and critic on the last states, a goal and, where there is one, a map of the ground (AdaptNet, Figure 3)."""

import copy
import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from murmillo.agents.common.heights import HeightMapEncoder
from murmillo.agents.common.networks import GaussianPolicy, Told, by_name, linear, mlp
from murmillo.agents.common.recurrent import LastOutput

LENGTH, GOAL = "length", "goal"
"""What policy and critic are told beside the states: valid frames `[...]`, goal `[..., G]`; `HEIGHTS` is a third."""


class HistoryEncoder(nn.Module):
    """Z^0: what a GRU makes of the last states, beside it the goal and the features of what else is shown."""

    def __init__(
        self,
        state_dim: int,
        goal_dim: int,
        units: int,
        generator: torch.Generator,
        controls: Sequence[HeightMapEncoder] = (),
    ) -> None:
        """
        Args:
            state_dim: D, features a frame.
            goal_dim: G; 0 for none.
            units: of the GRU.
            generator: draws the initial weights.
            controls: encoders of further inputs.
        """
        super().__init__()
        self.goal_dim = goal_dim
        self.history = LastOutput(state_dim, units, generator)
        self.controls = nn.ModuleList(controls)
        self.units = units
        self.size = units + goal_dim + sum(control.size for control in controls)

    def forward(self, state: Tensor, told: Told = None) -> Tensor:
        """`[..., Z]` of normalised states `[..., F, D]`, oldest first."""
        named = by_name(told)
        parts = [self.history(state, named.get(LENGTH))]
        if self.goal_dim:
            parts.append(named[GOAL])
        return torch.cat([*parts, *(control(told) for control in self.controls)], -1)


class RecurrentPolicy(GaussianPolicy):
    """A Gaussian whose standard deviation depends on the state too, on a `HistoryEncoder`'s latents."""

    def __init__(
        self,
        encoder: HistoryEncoder,
        action_dim: int,
        hidden: Sequence[int],
        std: float,
        generator: torch.Generator,
        std_least: float = 0.0,
    ) -> None:
        """
        Args:
            encoder: of states, goal and map.
            action_dim: A.
            hidden: sizes of the hidden layers.
            std: where the standard deviation begins; exp(-3) in the released code.
            generator: draws the initial weights.
            std_least: what it does not shrink below.
        """
        super().__init__(encoder.size, action_dim, hidden, std, generator, activation=nn.ReLU6)
        self.encoder = encoder
        self._least = math.log(std_least) if std_least else -math.inf
        self.spread = linear(hidden[-1], action_dim, generator, bound=1e-4)

    def encode(self, state: Tensor, told: Told = None) -> Tensor:
        return self.encoder(state, told)

    def copy_encoder(self) -> nn.Module:
        return copy.deepcopy(self.encoder)

    def read(self, features: Tensor) -> Tensor:
        """Mean and logarithm of the standard deviation `[..., 2 A]`."""
        return torch.cat([self.head(features), self.log_std + self.spread(features)], -1)

    def moments(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        mean, log_std = parameters.chunk(2, -1)
        return mean, log_std.clamp_min(self._least)


class ProgressivePolicy(RecurrentPolicy):
    """A new policy whose layers also see those of a frozen one: a progressive network (Rusu et al. 2016), the baseline.

    Its states are two `Views`, the frozen policy's and its own. Unlike an adapted policy it begins with random actions.
    """

    def __init__(
        self,
        base: RecurrentPolicy,
        encoder: HistoryEncoder,
        hidden: Sequence[int],
        std: float,
        generator: torch.Generator,
        std_least: float = 0.0,
    ) -> None:
        """
        Args:
            base: is frozen here, for good; has as many hidden layers.
            encoder: of the new policy.
            hidden, std, generator, std_least: as `RecurrentPolicy` has them.
        """
        actions = base.head.out_features
        super().__init__(encoder, actions, hidden, std, generator, std_least)
        self.base = base.requires_grad_(False)
        layers = [layer for layer in base.trunk if isinstance(layer, nn.Linear)]
        inputs = [layer.in_features for layer in layers]
        self.lateral = nn.ModuleList(
            [linear(a, b, generator) for a, b in zip(inputs, hidden, strict=True)]
            + [linear(layers[-1].out_features, 2 * actions, generator, bound=1e-4)]
        )

    def features(self, state: Tensor, told: Told = None) -> Tensor:
        """The last hidden layer of the new policy and of the frozen one, side by side."""
        base_state, own_state = state.chunk(2, -1)
        z, z_base = self.encode(own_state, told), self.base.encode(base_state, told)
        laterals = iter(self.lateral)
        for layer, base_layer in zip(self.trunk, self.base.trunk, strict=True):
            z = layer(z) + next(laterals)(z_base) if isinstance(layer, nn.Linear) else layer(z)
            z_base = base_layer(z_base)
        return torch.cat([z, z_base], -1)

    def read(self, features: Tensor) -> Tensor:
        own, base = features.split([self.head.in_features, features.shape[-1] - self.head.in_features], -1)
        return super().read(own) + self.lateral[-1](base)


class HistoryCritic(nn.Module):
    """Normalised returns of C objectives, by a network shaped like the policy's and separate from it."""

    def __init__(
        self,
        encoder: HistoryEncoder,
        hidden: Sequence[int],
        objectives: int,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.encoder = encoder
        self.trunk = mlp([encoder.size, *hidden], generator, activation=nn.ReLU6)
        self.head = linear(hidden[-1], objectives, generator, bound=1e-4)

    def forward(self, state: Tensor, told: Told = None) -> Tensor:
        """`[..., C]` of normalised states `[..., F, D]`; of several views of them it looks at the last."""
        own = state[..., -self.encoder.history.gru.input_size :]
        return self.head(self.trunk(self.encoder(own, told)))
