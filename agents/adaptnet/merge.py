"""Makes one plain network of a policy and its adapters, for inference (AdaptNet, section 9.1)."""

import copy
from collections.abc import Iterator

import torch
from torch import Tensor, nn

from murmillo.agents.adaptnet.networks import HistoryEncoder, RecurrentPolicy
from murmillo.agents.common.adapter import AdaptedPolicy, Adapter, affine, linear_layers
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.heights import HeightMapEncoder


@torch.no_grad()
def merge(policy: AdaptedPolicy) -> RecurrentPolicy:
    """The same actions from the same views, with the adapters at their present strengths.

    What is added to the hidden layers is added to their weights. All GRUs become one with block-diagonal weights, and
    what turned their outputs into a shift of the latents goes into the first layer, since nothing lies between.

    Raises:
        AgentError: the base is no `RecurrentPolicy`, or latents behind the first layer are shifted.
    """
    base, adapters = policy.base, policy.adapters
    if not isinstance(base, RecurrentPolicy):
        raise AgentError(f"a {type(base).__name__} cannot be merged with its adapters: its encoder is no GRU")
    if deep := [space for adapter in adapters for space in adapter.spaces if space > 1]:
        raise AgentError(f"an adapter that shifts the latent space {deep[0]} cannot be merged; 0 and 1 can")

    layout = _Layout(base, adapters)
    layers = [_with_adaptors(policy, number) for number in range(len(linear_layers(base)))]
    latent, offset = layout.shift(0, policy.strengths)
    latent[torch.arange(len(latent)), layout.latents[0]] += 1  # the base's own latent
    behind, behind_offset = layout.shift(1, policy.strengths)
    weight, bias = layers[0]
    layers[0] = weight @ latent + behind, weight @ offset + bias + behind_offset

    hidden = [len(bias) for _, bias in layers]
    merged = RecurrentPolicy(layout.encoder(), base.head.out_features, hidden, 1.0, torch.Generator())
    for target, (weight, bias) in zip(linear_layers(merged), layers, strict=True):
        target.weight.copy_(weight)
        target.bias.copy_(bias)
    merged.head.load_state_dict(base.head.state_dict())
    merged.spread.load_state_dict(base.spread.state_dict())
    merged.log_std.copy_(base.log_std)
    return merged.requires_grad_(False)


def _with_adaptors(policy: AdaptedPolicy, number: int) -> tuple[Tensor, Tensor]:
    """Weight and bias of a hidden layer and what the adapters add to it, float64."""
    layer = linear_layers(policy.base)[number]
    weight, bias = layer.weight.double(), layer.bias.double()
    for adapter, strength in zip(policy.adapters, policy.strengths, strict=True):
        if adapter.internal:
            more_weight, more_bias = affine(adapter.adaptors[number])
            weight, bias = weight + strength * more_weight, bias + strength * more_bias
    return weight, bias


class _Layout:
    """Where each part lies in the merged latent: the outputs of all GRUs, the goal, the features of all controls.

    Attributes:
        latents: columns of Z^0 as each encoder has it, the base's first and then each adapter's own or the base's.
        seen: columns that each adapter's embedding sees.
    """

    def __init__(self, base: RecurrentPolicy, adapters: list[Adapter]) -> None:
        self.base, self.adapters = base, adapters
        own = (adapter.encoder for adapter in adapters)
        self._encoders = [base.encoder, *(encoder if isinstance(encoder, HistoryEncoder) else None for encoder in own)]
        self._controls: list[HeightMapEncoder] = []
        units = iter(range(sum(encoder.units for encoder in self._encoders if encoder)))
        outputs = [_take(units, encoder.units) if encoder else [] for encoder in self._encoders]
        begin = sum(map(len, outputs))
        goal = list(range(begin, begin + base.encoder.goal_dim))
        self.total = begin + len(goal)

        self.latents: list[list[int]] = []
        for encoder, output in zip(self._encoders, outputs, strict=True):
            beside = [column for control in encoder.controls for column in self._place(control)] if encoder else []
            self.latents.append([*output, *goal, *beside] if encoder else self.latents[0])
        self.seen = [
            [*latent, *(self._place(adapter.control) if adapter.control is not None else [])]
            for latent, adapter in zip(self.latents[1:], adapters, strict=True)
        ]

    def _place(self, control: nn.Module) -> list[int]:
        """Columns for a control's features, behind all others."""
        assert isinstance(control, HeightMapEncoder)
        self._controls.append(copy.deepcopy(control))
        self.total += control.size
        return list(range(self.total - control.size, self.total))

    def shift(self, space: int, strengths: list[float]) -> tuple[Tensor, Tensor]:
        """How the adapters shift a latent space: a matrix on the merged latent and an offset, float64."""
        layers = linear_layers(self.base)
        size = layers[0].out_features if space else layers[0].in_features
        matrix, offset = torch.zeros(size, self.total, dtype=torch.float64), torch.zeros(size, dtype=torch.float64)
        for adapter, seen, strength in zip(self.adapters, self.seen, strengths, strict=True):
            if adapter.embed is not None and space in adapter.spaces:
                matrix[:, seen] += strength * adapter.split(adapter.embed.weight.T)[space].T
                offset += strength * adapter.split(adapter.embed.bias)[space]
        return matrix, offset

    def encoder(self) -> HistoryEncoder:
        """All encoders as one; each GRU reads its own view and knows nothing of the others."""
        inputs = self.base.encoder.history.gru.input_size
        units = sum(encoder.units for encoder in self._encoders if encoder)
        goal_dim = self.base.encoder.goal_dim
        merged = HistoryEncoder(len(self._encoders) * inputs, goal_dim, units, torch.Generator(), self._controls)
        weights = dict(merged.history.gru.named_parameters())
        for parameter in weights.values():
            parameter.zero_()
        begin = 0
        for view, encoder in enumerate(self._encoders):
            if encoder is None:
                continue
            columns = {"weight_ih_l0": slice(view * inputs, (view + 1) * inputs)}
            columns["weight_hh_l0"] = slice(begin, begin + encoder.units)
            for name, own in encoder.history.gru.named_parameters():
                for gate, part in enumerate(own.chunk(3)):
                    rows = slice(gate * units + begin, gate * units + begin + encoder.units)
                    place = (rows, columns[name]) if name in columns else rows
                    weights[name][place] = part
            begin += encoder.units
        return merged


def _take(numbers: Iterator[int], n: int) -> list[int]:
    return [next(numbers) for _ in range(n)]
