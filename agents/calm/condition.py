"""How CALM's discriminator learns which motion it is to judge by."""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.agents.common.discriminator import Condition
from murmillo.agents.common.networks import style_mlp


class LatentCondition(Condition):
    """Joins the latent `[B, Z]` to the window, after a style network as the policy's (CALM, appendix B)."""

    def __init__(self, latent_dim: int, hidden: Sequence[int], generator: torch.Generator) -> None:
        super().__init__()
        self.inputs = latent_dim
        self.style = style_mlp(latent_dim, hidden, generator)

    def join(self, x: Tensor, condition: Tensor | None) -> Tensor:
        assert condition is not None
        return torch.cat([x, self.style(condition)], -1)
