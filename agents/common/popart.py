"""Returns normalised in a way that leaves what the critic says as it was: PopArt (van Hasselt et al. 2016)."""

import torch
from torch import Tensor, nn

from murmillo.agents.common.ranks import ALONE, Ranks


class PopArt(nn.Module):
    """Mean and variance of C objectives' returns, each a moving average, and the critic's last layer that follows them.

    Every update of the statistics rescales that layer, so that the returns which it predicts stay the same to the last
    digits: mean + std (w x + b) does not change. The averages are float64 and free of the bias of their beginning.
    """

    mean: Tensor
    square: Tensor
    weight: Tensor

    def __init__(self, head: nn.Linear, momentum: float = 0.1, eps: float = 1e-5) -> None:
        """
        Args:
            head: the critic's last layer, of C outputs.
            momentum: share of a new batch in the averages (AdaptNet's code: 0.1).
            eps: least variance.
        """
        super().__init__()
        self._head = (head,)  # a tuple, lest the critic's parameters be this module's too
        self.momentum = momentum
        self.eps = eps
        self.register_buffer("mean", torch.zeros(head.out_features, dtype=torch.float64))
        self.register_buffer("square", torch.ones(head.out_features, dtype=torch.float64))
        self.register_buffer("weight", torch.zeros((), dtype=torch.float64))

    def forward(self, x: Tensor) -> Tensor:
        """Normalise returns `[..., C]`; as they are before the first update."""
        return ((x - self.mean) / self._std()).to(x.dtype)

    def inverse(self, y: Tensor) -> Tensor:
        """Undo `forward`."""
        return (y * self._std() + self.mean).to(y.dtype)

    @torch.no_grad()
    def update(self, returns: Tensor, *, ranks: Ranks = ALONE) -> None:
        """Take in returns `[..., C]`, of each rank as many, and rescale the critic's last layer."""
        rows = returns.reshape(-1, len(self.mean)).double()
        old_mean, old_std = self.mean.clone(), self._std()
        self.weight += self.momentum * (1 - self.weight)
        share = self.momentum / self.weight  # 1 at first, then ever nearer to the momentum
        self.mean += share * (ranks.mean(rows.mean(0)) - self.mean)
        self.square += share * (ranks.mean(rows.square().mean(0)) - self.square)
        std = self._std()
        head = self._head[0]
        head.weight *= (old_std / std)[:, None].to(head.weight.dtype)
        head.bias.copy_((old_std * head.bias + old_mean - self.mean) / std)

    def _std(self) -> Tensor:
        return (self.square - self.mean.square()).clamp(min=self.eps).sqrt()
