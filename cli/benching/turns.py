"""What is compared runs in turns: a machine's speed drifts by more than what is compared.

Every round lets each contestant run once; ratios are taken within the rounds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Protocol

Rates = Mapping[str, float]
"""Figures of one round, by name: so many a second."""


class Contestant(Protocol):
    """What takes turns."""

    def turn(self) -> Rates:
        """Run once; the names are the same every time."""
        ...


@dataclass(frozen=True)
class Spread:
    """Median and range over the rounds."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> "Spread":
        """Of one figure a round."""
        return cls(median(values), min(values), max(values))

    def __str__(self) -> str:
        digits = 1 if self.median >= 10 else 2
        return f"{self.median:.{digits}f} ({self.low:.{digits}f}-{self.high:.{digits}f})"


def one_round(contestants: Sequence[Contestant]) -> dict[str, float]:
    """A turn of each, their figures put together."""
    return {name: rate for contestant in contestants for name, rate in contestant.turn().items()}


def rate_of(rounds: Sequence[Rates], name: str) -> float:
    """The median rate."""
    return median(rates[name] for rates in rounds)


def ratio_of(rounds: Sequence[Rates], name: str, to: str) -> Spread:
    """The rate of `name` over that of `to`, within the rounds."""
    return Spread.of([rates[name] / rates[to] for rates in rounds])
