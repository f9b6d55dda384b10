"""Learning curves: the mean over the seeds of each group, with the bootstrap interval of that mean as a band."""

from pathlib import Path

import numpy as np

from murmillo.cli.adaptation.metrics import IMITATION
from murmillo.cli.comparison.grouping import Group
from murmillo.cli.comparison.record import Run
from murmillo.cli.comparison.statistics import bootstrap_interval
from murmillo.cli.metrics import EPISODE_LENGTH, STYLE, Metric
from murmillo.cli.plots import Scalars, smooth
from murmillo.cli.tasks.metrics import SIMILARITY, TASK

_COVERAGES = (
    Metric("coverage", "Coverage", "share", 3, "of the clips"),
    Metric("coverage_10", "Coverage, filtered at 10 %", "share", 3, "of the clips"),
)
_WITH_A_TASK = {"choices.task", "choices.stage"}
"""Settings that only runs of a task have, and those of AdaptNet, which all learn one."""
_POINTS = 200
_RESAMPLES = 1000
_AXES = {"samples": ("samples [million]", 1e6), "seconds": ("training time [h]", 3600.0)}


def plot_all(groups: list[Group], folder: Path) -> list[Path]:
    """One PNG a metric, against samples and against hours, of those that a group has a curve of; their paths."""
    paths = []
    for metric in (TASK, SIMILARITY, IMITATION, STYLE, EPISODE_LENGTH, *_COVERAGES):
        shown = [one for one in groups if all(_points(run, metric.scalar) > 1 for run in one.runs)]
        if metric is TASK:  # every run logs one, and without a task it is 0
            shown = [one for one in shown if one.settings.keys() & _WITH_A_TASK]
        if shown:
            paths.append(_plot(shown, groups, metric, folder / f"{metric.scalar.replace('/', '_')}.png"))
    return paths


def _points(run: Run, scalar: str) -> int:
    return int(np.isfinite(_columns(run, scalar).get(scalar, np.array([]))).sum())


def _columns(run: Run, scalar: str) -> Scalars:
    return run.history if scalar in run.history else run.scalars


def _plot(shown: list[Group], groups: list[Group], metric: Metric, path: Path) -> Path:
    # the object interface: pyplot would open the user's screen back end
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    colours = colormaps["tab10" if len(groups) <= 10 else "tab20"].colors  # type: ignore[attr-defined] # of a listed map
    figure = Figure(figsize=(9.6, 3.6), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (against, (title, scale)) in zip(figure.subplots(1, 2, sharey=True), _AXES.items(), strict=True):
        for one in shown:
            colour = colours[groups.index(one) % len(colours)]
            place, seeds = curve(one.runs, metric.scalar, against)
            axes.plot(
                place / scale,
                seeds.mean(axis=0),
                color=colour,
                linestyle="--" if one.conditions else "-",
                label=f"{one.label} ({len(seeds)})" + (", not comparable" if one.conditions else ""),
            )
            if len(seeds) > 1:
                low, high = bootstrap_interval([seeds], np.mean, _RESAMPLES)
                axes.fill_between(place / scale, low, high, color=colour, alpha=0.2, linewidth=0.0)
        axes.set_xlabel(title)
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
    first = figure.axes[0]
    first.set_ylabel(f"{metric.title} [{metric.unit}]" if metric.unit else metric.title)
    handles, labels = first.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(3, len(labels)), frameon=False, fontsize=8)
    figure.savefig(path)
    return path


def curve(runs: tuple[Run, ...], scalar: str, against: str) -> tuple[np.ndarray, np.ndarray]:
    """Places [P] of `against`, from where all have begun to the first end, and a smoothed scalar of each run [R, P]."""
    lines = []
    for columns in (_columns(run, scalar) for run in runs):
        known = np.isfinite(columns[scalar])
        lines.append((columns[against][known], smooth(columns[scalar][known])))
    begin, end = max(place[0] for place, _ in lines), min(place[-1] for place, _ in lines)
    places = np.linspace(begin, max(begin, end), _POINTS)
    return places, np.stack([np.interp(places, place, values) for place, values in lines])
