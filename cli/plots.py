"""The report's pictures, from the scalars of the log."""

from pathlib import Path

import numpy as np

from murmillo.cli.metrics import AGENT_SCORE, CLIP_SCORE, EPISODE_LENGTH, FALL_RATE, SKILL, STYLE, Metric
from murmillo.cli.skill_log import PREFIX

Scalars = dict[str, np.ndarray]
"""Columns of the log by name, each [iterations]; NaN where an iteration has no value."""

_PANELS: tuple[tuple[str, tuple[Metric, ...]], ...] = (
    ("episode_length", (EPISODE_LENGTH,)),
    ("fall_rate", (FALL_RATE,)),
    ("rewards", (STYLE, SKILL)),
    ("discriminator", (AGENT_SCORE, CLIP_SCORE)),
)
_SKILL_COLUMNS = 200
_COLOURS = ("#1f4e79", "#c8553d")


def plot_all(scalars: Scalars, folder: Path) -> list[Path]:
    """One PNG for each panel that has values, in `folder`; their paths in the panels' order."""
    folder.mkdir(exist_ok=True)
    paths = []
    for name, metrics in _PANELS:
        shown = [metric for metric in metrics if np.isfinite(scalars.get(metric.scalar, np.array([]))).any()]
        if shown:
            paths.append(_plot(scalars, shown, folder / f"{name}.png"))
    if skills := {name.removeprefix(PREFIX): smooth(scalars[name]) for name in scalars if name.startswith(PREFIX)}:
        paths.append(plot_skills(scalars["seconds"] / 60.0, skills, "training time [min]", folder / "skills.png"))
    return paths


def _plot(scalars: Scalars, metrics: list[Metric], path: Path) -> Path:
    # the object interface: pyplot would open the user's screen back end
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.2), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    minutes = scalars["seconds"] / 60.0
    for metric, colour in zip(metrics, _COLOURS, strict=False):
        values = scalars[metric.scalar]
        axes.plot(minutes, values, color=colour, alpha=0.25, linewidth=1.0)
        axes.plot(minutes, smooth(values), color=colour, linewidth=2.0, label=metric.title)
    unit = metrics[0].unit
    axes.set_xlabel("training time [min]")
    axes.set_ylabel(f"{metrics[0].title} [{unit}]" if len(metrics) == 1 and unit else metrics[0].title)
    if len(metrics) > 1:
        axes.set_ylabel("score" if metrics[0] is AGENT_SCORE else "reward")
        axes.legend(frameon=False)
    if all(np.nanmin(scalars[metric.scalar]) >= 0.0 for metric in metrics):
        axes.set_ylim(bottom=0.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.3)
    figure.savefig(path)
    return path


def plot_skills(places: np.ndarray, scores: Scalars, unit: str, path: Path) -> Path:
    """A row of colour for each skill, how its score goes; the best in the end on top.

    Args:
        places: [n], growing.
        scores: 0 to 1, of each skill by name, [n].
        unit: of the places.
        path: of the picture.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = dict(sorted(scores.items(), key=lambda row: -row[1][-1]))
    columns = np.linspace(places[0], places[-1], _SKILL_COLUMNS)
    figure = Figure(figsize=(6.4, 1.2 + 0.2 * len(rows)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    extent = (places[0], max(places[-1], places[0] + 1e-3), len(rows) - 0.5, -0.5)
    image = [np.interp(columns, places, row) for row in rows.values()]
    colours = axes.imshow(image, vmin=0.0, vmax=1.0, aspect="auto", extent=extent, interpolation="nearest")
    axes.set_yticks(range(len(rows)), list(rows), fontsize=8)
    axes.set_xlabel(unit)
    figure.colorbar(colours, ax=axes, label="score")
    figure.savefig(path)
    return path


def smooth(values: np.ndarray, share: float = 0.05) -> np.ndarray:
    """Running mean over `share` of the iterations, without the missing ones; as long as `values`."""
    width = max(1, round(share * len(values)))
    kernel = np.ones(width)
    known = np.isfinite(values)
    total = np.convolve(np.where(known, values, 0.0), kernel, mode="same")
    count = np.convolve(known.astype(float), kernel, mode="same")
    return np.divide(total, count, out=np.full(len(values), np.nan), where=count > 0)
