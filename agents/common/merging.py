"""Makes one plain network of a policy and its adapters, for playing (AdaptNet, section 9.1)."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from murmillo.agents.common.adapter import AdaptedPolicy, affine, linear_layers
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.heights import HeightMapEncoder
from murmillo.agents.common.networks import Policy, Told


@dataclass(frozen=True)
class Shape:
    """What stands side by side in a merged policy.

    Attributes:
        views: of the state: the base's, and one of each adapter.
        encoders: which of these views, counted from 0, have an encoder beside the base's.
        controls: which of them have an encoder of heights.
    """

    views: int
    encoders: tuple[int, ...]
    controls: tuple[int, ...]

    @classmethod
    def of(cls, policy: AdaptedPolicy) -> "Shape":
        """That which a policy with adapters will have."""
        own, maps = (
            tuple(view for view, adapter in enumerate(policy.adapters, 1) if getattr(adapter, part) is not None)
            for part in ("encoder", "control")
        )
        return cls(1 + len(policy.adapters), own, maps)

    @classmethod
    def load(cls, state: Mapping[str, Any]) -> "Shape":
        """From what `state` gave, also where a checkpoint has made lists of it."""
        return cls(state["views"], tuple(state["encoders"]), tuple(state["controls"]))

    def state(self) -> dict[str, Any]:
        """As JSON values."""
        return {"views": self.views, "encoders": list(self.encoders), "controls": list(self.controls)}


class MergedPolicy(Policy):
    """Encoders side by side, and one network on what they say; it does as an adapted policy did (`merge`).

    Its states are views, as an adapted policy's are.
    """

    def __init__(self, plain: Policy, shape: Shape) -> None:
        """
        Args:
            plain: of the base's kind; its first layer is made wider here, for all encoders.
            shape: what stands beside its own encoder.
        """
        super().__init__()
        first = linear_layers(plain)[0]
        self.shape = shape
        self.plain = plain
        self.encoders = nn.ModuleDict({str(view): plain.copy_encoder() for view in shape.encoders})
        self.controls = nn.ModuleDict({str(view): HeightMapEncoder(torch.Generator()) for view in shape.controls})
        width = (1 + len(shape.encoders)) * first.in_features + len(shape.controls) * HeightMapEncoder.size
        place = next(number for number, layer in enumerate(plain.trunk) if layer is first)
        plain.trunk[place] = nn.Linear(width, first.out_features)
        self.requires_grad_(False)

    def encode(self, state: Tensor, told: Told = None) -> Tensor:
        """What all encoders say of the views `[..., V D]`, side by side."""
        views = state.chunk(self.shape.views, -1)
        said = [self.plain.encode(views[0], told)]
        said += [encoder(views[int(view)], told) for view, encoder in self.encoders.items()]
        return torch.cat([*said, *(control(told) for control in self.controls.values())], -1)

    def features(self, state: Tensor, told: Told = None) -> Tensor:
        return self.plain.trunk(self.encode(state, told))

    def read(self, features: Tensor) -> Tensor:
        return self.plain.read(features)

    def moments(self, parameters: Tensor) -> tuple[Tensor, Tensor]:
        return self.plain.moments(parameters)


@torch.no_grad()
def merge(policy: AdaptedPolicy) -> MergedPolicy:
    """The same actions from the same views, with the adapters at their present strengths.

    What is added to the hidden layers is added to their weights. What turned an encoder's output into a shift of the
    latents goes into the first layer, since nothing lies between.

    Raises:
        AgentError: latents behind the first layer's output are shifted.
    """
    if deep := [space for adapter in policy.adapters for space in adapter.spaces if space > 1]:
        raise AgentError(
            f"an adapter that shifts the latent space {deep[0]} cannot be merged; 0 and 1 can, since no layer lies "
            "between them and what the shift is made of (agent.adapter.injection)"
        )
    shape = Shape.of(policy)
    merged = MergedPolicy(copy.deepcopy(policy.base), shape)
    for view, adapter in enumerate(policy.adapters, 1):
        for kept, part in ((merged.encoders, adapter.encoder), (merged.controls, adapter.control)):
            if part is not None:
                kept[str(view)].load_state_dict(part.state_dict())

    layers = [_with_adaptors(policy, number) for number in range(len(linear_layers(policy.base)))]
    weight, bias = layers[0]
    (latent, offset), (behind, behind_offset) = (_shift(policy, shape, space) for space in (0, 1))
    latent[:, : len(latent)] += torch.eye(len(latent))  # the base's own latent
    layers[0] = weight @ latent + behind, weight @ offset + bias + behind_offset
    for target, (weight, bias) in zip(linear_layers(merged.plain), layers, strict=True):
        target.weight.copy_(weight)
        target.bias.copy_(bias)
    return merged


def _with_adaptors(policy: AdaptedPolicy, number: int) -> tuple[Tensor, Tensor]:
    """Weight and bias of a hidden layer and what the adapters add to it, float64."""
    layer = linear_layers(policy.base)[number]
    weight, bias = layer.weight.double(), layer.bias.double()
    for adapter, strength in zip(policy.adapters, policy.strengths, strict=True):
        if adapter.internal:
            more_weight, more_bias = affine(adapter.adaptors[number])
            weight, bias = weight + strength * more_weight, bias + strength * more_bias
    return weight, bias


def _shift(policy: AdaptedPolicy, shape: Shape, space: int) -> tuple[Tensor, Tensor]:
    """How the adapters shift a latent space: a matrix on what all encoders say, and an offset, float64."""
    first = linear_layers(policy.base)[0]
    size, latent = first.out_features if space else first.in_features, first.in_features
    width = (1 + len(shape.encoders)) * latent + len(shape.controls) * HeightMapEncoder.size
    matrix, offset = torch.zeros(size, width, dtype=torch.float64), torch.zeros(size, dtype=torch.float64)
    for view, (adapter, strength) in enumerate(zip(policy.adapters, policy.strengths, strict=True), 1):
        if adapter.embed is not None and space in adapter.spaces:
            seen = _columns(0 if adapter.encoder is None else 1 + shape.encoders.index(view), latent)
            if adapter.control is not None:
                begin = width - (len(shape.controls) - shape.controls.index(view)) * HeightMapEncoder.size
                seen += range(begin, begin + HeightMapEncoder.size)
            matrix[:, seen] += strength * adapter.split(adapter.embed.weight.T)[space].T
            offset += strength * adapter.split(adapter.embed.bias)[space]
    return matrix, offset


def _columns(place: int, size: int) -> list[int]:
    """Of the encoder at this place."""
    return list(range(place * size, (place + 1) * size))
