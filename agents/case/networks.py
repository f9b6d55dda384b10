"""How C·ASE's networks are told the skill (appendix A.4.3)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from murmillo.agents.common.discriminator import Condition
from murmillo.agents.common.networks import linear, mlp


class LabelEmbedding(nn.Module):
    """A learnt point on the sphere for each of K labels, at first anywhere on it."""

    def __init__(self, labels: int, dim: int, generator: torch.Generator) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(labels, dim, generator=generator))

    def forward(self, label: Tensor) -> Tensor:
        """`[..., dim]` of unit length from labels `[...]` int64."""
        return F.normalize(F.embedding(label, self.weight), dim=-1)


class SkillHeads(Condition):
    """The discriminator has an output for each of K skills and is asked by the label, int64 `[B]`, for one."""

    def __init__(self, labels: int) -> None:
        super().__init__()
        self.outputs = labels

    def pick(self, logits: Tensor, condition: Tensor | None) -> Tensor:
        assert condition is not None
        return logits.gather(1, condition[:, None]).squeeze(1)


class Encoder(nn.Module):
    """The mean of q(z | s, s', c), a von Mises-Fisher distribution over latents."""

    def __init__(
        self,
        window_size: int,
        hidden: Sequence[int],
        latent_dim: int,
        labels: int,
        label_dim: int,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.label = LabelEmbedding(labels, label_dim, generator)
        self.trunk = mlp([window_size + label_dim, *hidden], generator)
        self.head = linear(hidden[-1], latent_dim, generator, bound=0.1)

    def forward(self, x: Tensor, label: Tensor) -> Tensor:
        """mu_q `[B, Z]` of unit length, from prepared windows `[B, W D]` and labels `[B]`."""
        return F.normalize(self.head(self.trunk(torch.cat([x, self.label(label)], -1))), dim=-1)
