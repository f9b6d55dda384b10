"""The figures of all groups side by side."""

import math
from collections.abc import Iterator

from murmillo.cli.comparison.grouping import Group
from murmillo.cli.comparison.record import (
    COVERAGES,
    EVALUATION,
    FALLS,
    HOURS,
    LENGTH,
    LOG,
    NORMALISED_RETURN,
    SAMPLES,
    STYLE_SCORE,
    THROUGHPUT,
    Quantity,
)
from murmillo.cli.comparison.statistics import Summary, summarise
from murmillo.cli.metrics import EPISODE_LENGTH, STYLE

Table = dict[Quantity, dict[str, Summary]]
"""The summary of a quantity by label of the group; groups that have not measured it are missing."""

_ARROWS = {"up": " ↑", "down": " ↓"}
_ORDER = (NORMALISED_RETURN, STYLE_SCORE, LENGTH, FALLS)


def tabulate(groups: list[Group]) -> Table:
    """Everything that was measured: the trained policies first, then the evaluation, then the training."""
    table: Table = {}
    for one in groups:
        scores: dict[Quantity, list[float]] = {}
        for run in one.runs:
            for quantity, value in run.figures.items():
                scores.setdefault(quantity, []).append(value)
        for quantity, values in scores.items():
            table.setdefault(quantity, {})[one.label] = summarise(values)
    for quantity, label, values in _at_common_samples(groups):
        table.setdefault(quantity, {})[label] = summarise(values)
    return {quantity: table[quantity] for quantity in sorted(table, key=_rank)}


def headlines(table: Table) -> list[Quantity]:
    """What a reader looks for first: return, style score, episode length, coverage, samples and speed."""
    return [
        quantity
        for quantity in table
        if quantity in (*_ORDER, SAMPLES, HOURS, THROUGHPUT)
        or (quantity.source == EVALUATION and quantity.name in COVERAGES)
        or (quantity.source == LOG and quantity.name.startswith(STYLE.scalar))
    ]


def heading(quantity: Quantity) -> str:
    """Title, unit and which way is good."""
    unit = f" [{quantity.unit}]" if quantity.unit else ""
    return f"{quantity.title}{unit}{_ARROWS.get(quantity.better, '')}"


def cell(quantity: Quantity, summary: Summary | None) -> str:
    """The interquartile mean and its interval; of what is no result the range; one value where there is but one."""
    if summary is None:
        return "-"
    least, most = min(summary.scores), max(summary.scores)
    if summary.interval is None or least == most:
        return number(summary.iqm)
    if quantity in (SAMPLES, HOURS):
        return f"{number(least)} to {number(most)}"
    return f"{number(summary.iqm)} {interval(summary.interval)}"


def interval(ends: tuple[float, float]) -> str:
    """The two ends in brackets."""
    return f"[{number(ends[0])}, {number(ends[1])}]"


def number(value: float) -> str:
    """Three figures; whole numbers from a thousand on."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _at_common_samples(groups: list[Group]) -> Iterator[tuple[Quantity, str, list[float]]]:
    """Curves of the groups under equal conditions, read where the shortest of their runs ends, if others go on."""
    equals = [one for one in groups if not one.conditions]
    common = min(one.samples for one in equals)
    if all(run.samples == common for one in equals for run in one.runs):
        return
    for metric in (STYLE, EPISODE_LENGTH):
        quantity = Quantity(LOG, f"{metric.scalar}@", f"{metric.title} at {common:,.0f} samples", metric.unit)
        for one in equals:
            values = [run.mean_until(metric.scalar, common) for run in one.runs]
            if known := [value for value in values if math.isfinite(value)]:
                yield quantity, one.label, known


def _rank(quantity: Quantity) -> tuple[int, int]:
    """Sorts by source, and what is looked for first within it; all else stays as it was read."""
    sources = (STYLE_SCORE.source, EVALUATION, LOG)
    first = (*_ORDER, SAMPLES, HOURS, THROUGHPUT)
    return sources.index(quantity.source), first.index(quantity) if quantity in first else len(first)
