"""A figure with its spread, as the papers print it: mean ± standard deviation."""

from dataclasses import dataclass
from typing import Self

from torch import Tensor


@dataclass(frozen=True)
class Spread:
    """Mean and sample standard deviation of `count` values; NaN where there are too few values for one."""

    mean: float
    deviation: float
    count: int

    @classmethod
    def of(cls, values: Tensor) -> Self:
        """Of all values, whatever their shape."""
        values = values.detach().double().flatten()
        deviation = values.std().item() if len(values) > 1 else float("nan")
        return cls(values.mean().item(), deviation, len(values))
