"""What is kept of a study: the curve of every run, thinned, what was measured at its end, and a picture of all."""

from pathlib import Path
from typing import Any

import numpy as np

from murmillo.cli import runs
from murmillo.cli.plots import smooth
from murmillo.cli.report import read_scalars

CURVES = {
    "episode/length": "episode length [steps]",
    "reward/style": "style reward",
    "reward/task": "goal reward",
    "reward/imitation": "imitation reward",  # AdaptNet's name for it
    "discriminator/agent_score": "discriminator on the agent",
}
_IMITATION = "reward/imitation"
_SHOWN = ("episode/length", "reward/style", "discriminator/agent_score")
_SHOWN_OF_ADAPTNET = ("episode/length", "reward/task", _IMITATION)
_POINTS = 40


def collect(study: Any, folders: dict[str, list[Path]]) -> dict[str, Any]:
    """The results of a `Study` from the runs of each variant, ready for JSON; of those under way, the curves so far."""
    variants: dict[str, Any] = {}
    for variant, found in folders.items():
        kept = {folder.name.rpartition("-")[2]: _run(folder) for folder in found}
        variants[variant] = {"words": list(study.variants[variant]), "seeds": kept}
    first = next(folder for found in folders.values() for folder in found)
    return {
        "question": study.question,
        "words": list(study.words),
        "versions": runs.read_json(first / runs.VERSIONS),
        "variants": variants,
    }


def _run(folder: Path) -> dict[str, Any]:
    scalars = read_scalars(folder / runs.SCALARS)
    samples = scalars["samples"]
    places = np.linspace(samples[0], samples[-1], _POINTS)
    shown = _SHOWN_OF_ADAPTNET if _IMITATION in scalars else _SHOWN
    curves = {name: _curve(places, samples, smooth(scalars[name])) for name in ("seconds", *shown)}
    measured = runs.read_json(folder / runs.MEASURES, {}).get("trained", {})
    return {"samples": places.astype(int).tolist(), **curves, "measured": measured}


def _curve(places: np.ndarray, samples: np.ndarray, values: np.ndarray) -> list[float | None]:
    """The values at these places; None before there is one: no episode has ended yet."""
    known = np.isfinite(values)
    if not known.any():
        return [None] * len(places)
    found = np.interp(places, samples[known], values[known], left=np.nan, right=np.nan)
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in found]


def plot(results: dict[str, Any], path: Path) -> Path:
    """The curves of all variants, the mean over the seeds; a line a seed behind it, paler."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    first = next(seed for kept in results["variants"].values() for seed in kept["seeds"].values())
    curves = {name: title for name, title in CURVES.items() if name in first}
    figure = Figure(figsize=(4.2 * len(curves), 3.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, title) in zip(figure.subplots(1, len(curves)), curves.items(), strict=True):
        for number, (variant, kept) in enumerate(results["variants"].items()):
            seeds = list(kept["seeds"].values())
            if not seeds:
                continue
            least = min(seed["samples"][-1] for seed in seeds)
            places = np.linspace(0, least, _POINTS)
            lines = [np.interp(places, seed["samples"], np.array(seed[name], dtype=float)) for seed in seeds]
            for line in lines if len(lines) > 1 else ():
                axes.plot(places / 1e6, line, color=f"C{number}", alpha=0.25, linewidth=0.8)
            axes.plot(places / 1e6, np.mean(lines, axis=0), color=f"C{number}", label=f"{variant} ({len(lines)})")
        axes.set_xlabel("samples [million]")
        axes.set_title(title, fontsize=10)
        if name != _IMITATION:  # it is signed
            axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(results["question"], fontsize=11)
    figure.savefig(path)
    return path
