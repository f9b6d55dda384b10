"""What policies see of uneven ground: a map of its heights (AdaptNet, section 8.3.2)."""

import math

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import Told, by_name

HEIGHTS = "heights"
"""The observation, and what policy and critic are told under this name: a map `[..., 35, 35]` [m]."""
MAP_SIZE = 35
"""Cells of the map in each direction that the convolutions are made for."""


class HeightMapEncoder(nn.Module):
    """G: 256 features of a map of the ground, 35 x 35 cells."""

    size = 256

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        convolutions = [
            nn.Conv2d(1, 32, 5, stride=5),
            nn.Conv2d(32, 64, 3),
            nn.Conv2d(64, 128, 3),
            nn.Conv2d(128, self.size, 3),
        ]
        for layer in convolutions:
            bound = 1 / math.sqrt(layer.weight[0].numel())
            nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
            nn.init.zeros_(layer.bias)  # type: ignore[arg-type]  # it has one
        first, *others = convolutions
        self.layers = nn.Sequential(first, *(part for layer in others for part in (nn.ReLU(), layer)), nn.Flatten())

    def forward(self, told: Told) -> Tensor:
        """`[..., 256]` of the map `[..., 35, 35]` [m], normalised by the environment."""
        heights = by_name(told)[HEIGHTS]
        return self.layers(heights.flatten(0, -3)[:, None]).unflatten(0, heights.shape[:-2])


def check_map(shape: tuple[int, ...]) -> None:
    """Refuse a map that the convolutions are not made for."""
    if shape != (MAP_SIZE, MAP_SIZE):
        raise AgentError(f"the environment's 'heights' are {list(shape)}; the policy reads [{MAP_SIZE}, {MAP_SIZE}]")
