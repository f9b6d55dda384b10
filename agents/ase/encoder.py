"""The skill encoder q(z | s, s') (ASE, section 6.2)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from murmillo.agents.common.networks import linear, mlp


class Encoder(nn.Module):
    """The mean of a von Mises-Fisher distribution over latents, from the discriminator's features or its own trunk."""

    def __init__(
        self, window_size: int, hidden: Sequence[int], latent_dim: int, shared_trunk: bool, generator: torch.Generator
    ) -> None:
        super().__init__()
        self.trunk = None if shared_trunk else mlp([window_size, *hidden], generator)
        self.head = linear(hidden[-1], latent_dim, generator, bound=0.1)

    def forward(self, x: Tensor, features: Tensor) -> Tensor:
        """mu_q `[B, Z]` of unit length, from prepared windows `[B, W D]` and the discriminator's features `[B, H]`."""
        return F.normalize(self.head(features if self.trunk is None else self.trunk(x)), dim=-1)
