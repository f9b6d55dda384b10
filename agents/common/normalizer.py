"""Running mean and variance, for observations, windows and returns."""

import torch
from torch import Tensor, nn

from murmillo.agents.common.ranks import ALONE, Ranks


class RunningNormalizer(nn.Module):
    """(x - mean) / sqrt(var + eps), clipped; the statistics are float64 and move only in `update`.

    Until the first update it only clips. The loop updates it once an iteration, after the update that used it, so that
    the actions of a rollout and the losses on it see one and the same normalisation.
    """

    mean: Tensor
    var: Tensor
    count: Tensor
    frozen: Tensor

    def __init__(self, shape: tuple[int, ...] = (), clip: float = 5.0, eps: float = 1e-5) -> None:
        super().__init__()
        self.clip = clip
        self.eps = eps
        self.register_buffer("mean", torch.zeros(shape, dtype=torch.float64))
        self.register_buffer("var", torch.ones(shape, dtype=torch.float64))
        self.register_buffer("count", torch.zeros((), dtype=torch.float64))
        self.register_buffer("frozen", torch.tensor(False))

    def forward(self, x: Tensor) -> Tensor:
        """Normalise `[..., *shape]` to about unit size, within +-clip."""
        centred = x - self.mean.to(x.dtype)
        return centred.div_(self._std(x)).clamp_(-self.clip, self.clip)  # in place: windows are megabytes

    def inverse(self, y: Tensor) -> Tensor:
        """Undo `forward`, but for the clipping."""
        return y * self._std(y) + self.mean.to(y.dtype)

    def _std(self, like: Tensor) -> Tensor:
        return torch.sqrt(self.var + self.eps).to(like.dtype)

    @torch.no_grad()
    def update(self, batch: Tensor, left_out: Tensor | None = None, *, ranks: Ranks = ALONE) -> None:
        """Take in a batch `[..., *shape]` (Chan et al.'s parallel form of Welford's algorithm).

        Args:
            batch: `[..., *shape]`.
            left_out: bool, broadcast to the batch's shape; true where an element says nothing. It then counts as if it
                were like those of its feature that do, or like all before it where none does.
            ranks: who have a batch each, of which nothing is left out; without them every rank has the same batch.
        """
        if self.frozen:
            return
        rows = batch.reshape(-1, *self.mean.shape).double()
        if left_out is None:
            var, mean = torch.var_mean(rows, dim=0, correction=0)
        else:
            var, mean = self._moments(rows, ~left_out.expand(batch.shape).reshape(rows.shape))
        count, mean, var = ranks.moments(len(rows), mean, var)
        total = self.count + count
        delta = mean - self.mean
        moment = self.var * self.count + var * count + delta.square() * self.count * count / total
        self.mean += delta * count / total
        self.var.copy_(moment / total)
        self.count.copy_(total)

    def _moments(self, rows: Tensor, kept: Tensor) -> tuple[Tensor, Tensor]:
        """Variance and mean of each feature over the elements that are kept, bool like `rows`."""
        count = kept.sum(0)
        mean = torch.where(kept, rows, 0.0).sum(0) / count
        var = torch.where(kept, rows - mean, 0.0).square().sum(0) / count
        return torch.where(count > 0, var, self.var), torch.where(count > 0, mean, self.mean)

    def freeze(self) -> None:
        """Stop learning, for good: a checkpoint remembers it."""
        self.frozen.fill_(True)
