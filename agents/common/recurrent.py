"""A GRU whose last output stands for a short sequence."""

import math

import torch
from torch import Tensor, nn


class LastOutput(nn.Module):
    """The output of a GRU at the last valid frame of each sequence."""

    def __init__(self, inputs: int, units: int, generator: torch.Generator) -> None:
        """Weights and biases ~ U(-1 / sqrt(units), 1 / sqrt(units)), PyTorch's own distribution."""
        super().__init__()
        self.gru = nn.GRU(inputs, units, batch_first=True)
        bound = 1 / math.sqrt(units)
        for parameter in self.gru.parameters():
            nn.init.uniform_(parameter, -bound, bound, generator=generator)

    def forward(self, frames: Tensor, length: Tensor | None = None) -> Tensor:
        """`[..., H]` of sequences `[..., F, D]`, oldest frame first, of which the first `length` `[...]` are valid.

        All are valid without a length. What is behind the valid frames has no influence, gradients included.
        """
        # how the GRU rounds depends on the strides, and a frozen copy sees a part of a larger tensor
        outputs, _ = self.gru(frames.flatten(0, -3).contiguous())
        if length is None:
            last = outputs[:, -1]
        else:
            last = outputs[torch.arange(len(outputs)), length.flatten().clamp(1, outputs.shape[1]) - 1]
        return last.unflatten(0, frames.shape[:-2])
