"""A measured figure, and how sure it is."""

from collections.abc import Callable
from typing import Any, NamedTuple

import torch
from torch import Tensor

_DRAWS = 200
_BLOCKS = 10


class Value(NamedTuple):
    """A figure.

    Attributes:
        value: in the unit of its `FigureKind`; NaN where there is none, such as a time of recovery without a fall.
        samples: how many trajectories, windows or trials it is of.
        spread: standard deviation, where one is defined.
        spread_of: what deviates: the figure itself under resampling, or single draws.
    """

    value: float
    samples: int
    spread: float | None = None
    spread_of: str | None = None


class Outcome(NamedTuple):
    """What a metric found: its figures by name, and curves for the plots, JSON values by name."""

    values: dict[str, Value]
    curves: dict[str, Any]


def bootstrapped(figure: Callable[[Tensor], float], n: int, generator: torch.Generator) -> Value:
    """A figure of n trajectories with its deviation over 200 resamplings (Efron 1979).

    Args:
        figure: of the rows [m] that count, each as often as it is there.
    """
    value = figure(torch.arange(n))
    if n < 2:
        return Value(value, n)
    draws = [figure(torch.randint(n, (n,), generator=generator)) for _ in range(_DRAWS)]
    return Value(value, n, torch.tensor(draws, dtype=torch.float64).std().item(), f"bootstrap, {_DRAWS} draws")


def blocked(figure: Callable[[Tensor], float], n: int) -> Value:
    """A mean over n trajectories with its deviation, from that among ten equal blocks of them."""
    value = figure(torch.arange(n))
    blocks = torch.tensor([figure(rows) for rows in torch.arange(n).chunk(_BLOCKS)], dtype=torch.float64)
    blocks = blocks[blocks.isfinite()]
    if len(blocks) < 2:
        return Value(value, n)
    return Value(value, n, (blocks.std() / len(blocks) ** 0.5).item(), f"{len(blocks)} blocks")
