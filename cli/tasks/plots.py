"""The learning curve of a task."""

from pathlib import Path

import numpy as np

from murmillo.cli.metrics import STYLE, Metric
from murmillo.cli.plots import Scalars, smooth
from murmillo.cli.tasks.metrics import SIMILARITY, TASK


def plot_learning(
    scalars: Scalars, steps: int, folder: Path, metrics: tuple[Metric, ...] = (TASK, SIMILARITY, STYLE)
) -> Path:
    """Those of the metrics that there are against control steps; `steps` make a sample."""
    # the object interface: pyplot would open the user's screen back end
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    folder.mkdir(exist_ok=True)
    shown = [metric for metric in metrics if np.isfinite(scalars.get(metric.scalar, np.array([]))).any()]
    figure = Figure(figsize=(6.4, 3.2 * len(shown)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    for place, metric in enumerate(shown, start=1):
        axes = figure.add_subplot(len(shown), 1, place)
        values, millions = scalars[metric.scalar], steps * scalars["samples"] / 1e6
        axes.plot(millions, values, color="#1f4e79", alpha=0.25, linewidth=1.0)
        axes.plot(millions, smooth(values), color="#1f4e79", linewidth=2.0)
        axes.set(xlabel="control steps [million]", ylabel=metric.title)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
    path = folder / "learning_curve.png"
    figure.savefig(path)
    return path
