"""What is kept of a study: the curve of every run, thinned, what was measured at its end, and a picture of all."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from murmillo.cli import runs
from murmillo.cli.evaluation import history
from murmillo.cli.plots import plot_skills, smooth
from murmillo.cli.report import read_scalars
from murmillo.cli.skill_log import PREFIX

CURVES = {
    "episode/length": "episode length [steps]",
    "episode/fall_rate": "fall rate",
    "reward/style": "style reward",
    "reward/task": "goal reward",
    "reward/imitation": "imitation reward",  # AdaptNet's name for it
    "discriminator/agent_score": "discriminator on the agent",
}
_IMITATION = "reward/imitation"
_SHOWN = ("episode/length", "episode/fall_rate", "reward/style", "discriminator/agent_score")
_SHOWN_OF_ADAPTNET = ("episode/length", "episode/fall_rate", "reward/task", _IMITATION)
ALONG = {"coverage_10": "coverage, filter 10 %", "controllability": "seen as commanded"}
"""Measured of the checkpoints on the way."""
_POINTS = 40
_SKILL_POINTS = 10


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
    found = {"samples": places.astype(int).tolist(), **curves}
    if skills := [name for name in scalars if name.startswith(PREFIX)]:
        fewer = np.linspace(samples[0], samples[-1], _SKILL_POINTS)
        found["skills"] = {name.removeprefix(PREFIX): _curve(fewer, samples, smooth(scalars[name])) for name in skills}
    if rows := history.read(folder / runs.HISTORY):
        names = [name for name in ALONG if all(name in row for row in rows)]
        found["along"] = {"samples": [int(row["samples"]) for row in rows]}
        found["along"] |= {name: [float(row[name]) for row in rows] for name in names}
    return found | {"measured": runs.read_json(folder / runs.MEASURES, {}).get("trained", {})}


def _curve(places: np.ndarray, samples: np.ndarray, values: np.ndarray) -> list[float | None]:
    """The values at these places; None before there is one: no episode has ended yet."""
    known = np.isfinite(values)
    if not known.any():
        return [None] * len(places)
    found = np.interp(places, samples[known], values[known], left=np.nan, right=np.nan)
    return [float(f"{value:.4g}") if np.isfinite(value) else None for value in found]


def plot(results: dict[str, Any], path: Path) -> list[Path]:
    """The curves of all variants, the mean over the seeds; a line a seed behind it, paler. Another of each skill.

    Returns:
        the pictures: `path`, and beside it one for each variant whose log follows the skills.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    variants = {name: list(kept["seeds"].values()) for name, kept in results["variants"].items() if kept["seeds"]}
    everyone = [seed for seeds in variants.values() for seed in seeds]
    panels = {name: title for name, title in (CURVES | ALONG).items() if all(_points(seed, name) for seed in everyone)}
    figure = Figure(figsize=(3.4 * len(panels), 3.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, title) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        for number, (variant, seeds) in enumerate(variants.items()):
            _draw(axes, [_points(seed, name) for seed in seeds], f"C{number}", f"{variant} ({len(seeds)})")
        axes.set_xlabel("samples [million]")
        axes.set_title(title, fontsize=10)
        if name != _IMITATION:  # it is signed
            axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="y", alpha=0.3)
        if len(variants) == 1:
            _minutes(axes, everyone)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.suptitle(results["question"], fontsize=11)
    figure.savefig(path)
    skilled = {name: seeds for name, seeds in variants.items() if all(len(s.get("skills", ())) > 1 for s in seeds)}
    return [path, *(_plot_skills(seeds, name, path) for name, seeds in skilled.items())]


def _points(seed: dict[str, Any], name: str) -> tuple[list[int], list[float | None]] | None:
    """A curve of a run, by samples; None where it has none."""
    place = seed.get("along", {}) if name in ALONG else seed
    return (place["samples"], place[name]) if name in place else None


def _draw(axes: Any, curves: Sequence[Any], colour: str, label: str) -> None:
    first, last = max(samples[0] for samples, _ in curves), min(samples[-1] for samples, _ in curves)
    places = np.linspace(first, last, _POINTS)
    lines = [np.interp(places, samples, np.array(values, dtype=float)) for samples, values in curves]
    for line in lines if len(lines) > 1 else ():
        axes.plot(places / 1e6, line, color=colour, alpha=0.25, linewidth=0.8)
    axes.plot(places / 1e6, np.mean(lines, axis=0), color=colour, label=label)


def _minutes(axes: Any, seeds: Sequence[dict[str, Any]]) -> None:
    """A scale of minutes above that of samples: all runs are of one kind, and have one pace."""
    pace = np.mean([seed["samples"][-1] / seed["seconds"][-1] for seed in seeds]) * 60 / 1e6
    upper = axes.secondary_xaxis("top", functions=(lambda million: million / pace, lambda minutes: minutes * pace))
    upper.tick_params(labelsize=8)
    upper.set_xlabel("minutes", fontsize=8)


def _plot_skills(seeds: Sequence[dict[str, Any]], variant: str, path: Path) -> Path:
    """The score of each skill by samples, the mean over the seeds."""
    rows = {name: np.mean([seed["skills"][name] for seed in seeds], axis=0) for name in seeds[0]["skills"]}
    places = np.linspace(0.0, min(seed["samples"][-1] for seed in seeds) / 1e6, _SKILL_POINTS)
    return plot_skills(places, rows, "samples [million]", path.with_name(f"{path.stem}_skills_{variant}.png"))
