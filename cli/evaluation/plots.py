"""The pictures of an evaluation, from its curves."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from murmillo.cli.evaluation.judging import RATES
from murmillo.cli.evaluation.sources import SOURCES, TRAINED, UNTRAINED

_COLOURS = {TRAINED: "#1f4e79", UNTRAINED: "#9a9a9a", "replayed": "#c8553d"}
_NAMED = 60
"""Clips whose names fit beside an axis."""


def plot_all(
    results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]], folder: Path
) -> list[tuple[str, Path]]:
    """One PNG for each picture that there are curves for, in `folder`; their captions and paths."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*.png"):
        old.unlink()
    pictures = []
    for name, (caption, draw) in _PICTURES.items():
        figure = draw(results, curves, history)
        if figure is not None:
            figure.savefig(folder / f"{name}.png")
            pictures.append((caption, folder / f"{name}.png"))
    return pictures


def _figure(width: float = 6.4, height: float = 3.6) -> Any:
    # the object interface: pyplot would open the user's screen back end
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _axes(figure: Any, *place: int) -> Any:
    axes = figure.add_subplot(*place)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.3)
    return axes


def _coverage(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    if not curves.get("coverage"):
        return None
    figure = _figure()
    axes = _axes(figure)
    for source, found in curves["coverage"].items():
        rates, covered = 100 * np.array(RATES), 100 * np.array(found["coverage"])
        axes.plot(rates, covered, color=_COLOURS[source], linewidth=2.0, label=SOURCES[source])
    axes.set(xlabel="filtering rate [%]", ylabel="coverage [%]", ylim=(0, 103), xlim=(0, 50))
    axes.legend(frameon=False)
    return figure


def _frequencies(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    counts = curves.get("coverage", {}).get(TRAINED, {}).get("frequencies")
    if not counts:
        return None
    names, counts = np.array(results["clips"]["names"]), np.array(counts)
    order = np.argsort(-counts, kind="stable")
    figure = _figure(max(6.4, 0.16 * len(names)), 4.2)
    axes = _axes(figure)
    axes.grid(visible=False, axis="x")
    axes.bar(np.arange(len(names)), 100 * counts[order] / counts.sum(), color=_COLOURS[TRAINED])
    axes.axhline(100 / len(names), color="#c8553d", linewidth=1.0, label="even")
    axes.set(ylabel="trajectories [%]", xlim=(-0.6, len(names) - 0.4))
    axes.set_xticks(np.arange(len(names)), names[order], rotation=90, fontsize=6)  # the picture is as wide as they need
    axes.legend(frameon=False)
    return figure


def _obeyed(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    found = curves.get("controllability", {}).get(TRAINED, {})
    if not found.get("seen"):  # an evaluation of before there were any
        return None
    seen, names = 100 * np.array(found["seen"]), found["names"]
    columns = [*names, "(none)"][: seen.shape[1]]
    return _matrix(seen, names, "seen as", "commanded", "windows [%]", columns)


def _transitions(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    matrix = curves.get("transitions", {}).get(TRAINED, {}).get("transitions")
    return matrix and _matrix(np.array(matrix), results["clips"]["names"], "clip after", "clip before", "probability")


def _distances(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    matrix = curves.get("concentration", {}).get(TRAINED, {}).get("distances")
    return matrix and _matrix(np.array(matrix), results["clips"]["names"], "clip", "clip", "mean distance of latents")


def _matrix(
    values: np.ndarray, names: list[str], across: str, down: str, meaning: str, columns: list[str] | None = None
) -> Any:
    """A picture of values [n, m] with names of the rows, and of the columns too unless they have their own."""
    side = min(12.0, max(5.0, 0.15 * len(names) + 2.0))
    figure = _figure(side + 1.0, side)
    axes = figure.add_subplot()
    image = axes.imshow(values, cmap="viridis", vmin=0.0)
    figure.colorbar(image, ax=axes, label=meaning, shrink=0.7)
    axes.set(xlabel=across, ylabel=down)
    _name(axes.set_xticks, names if columns is None else columns, rotation=90)
    _name(axes.set_yticks, names)
    return figure


def _paths(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    skills = curves.get("diversity", {}).get(TRAINED, {}).get("paths")
    if not skills:
        return None
    columns = min(5, len(skills))
    rows = -(-len(skills) // columns)
    figure = _figure(2.1 * columns + 0.4, 2.2 * rows + 0.4)
    reach = max(0.5, *(float(np.abs(np.array(skill["paths"])).max()) for skill in skills))
    for number, skill in enumerate(skills, start=1):
        axes = _axes(figure, rows, columns, number)
        for path in np.array(skill["paths"]):
            axes.plot(path[:, 0], path[:, 1], color=_COLOURS[TRAINED], alpha=0.6, linewidth=1.0)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
        axes.set_title(skill["name"], fontsize=8)
        axes.tick_params(labelsize=7)
    figure.supxlabel("ahead of the start [m]", fontsize=9)
    figure.supylabel("to the left [m]", fontsize=9)
    return figure


def _maps(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    found = curves.get("concentration", {}).get(TRAINED)
    if not found:
        return None
    maps = [(name, np.array(found[key])) for key, name in (("mds", "MDS"), ("tsne", "t-SNE")) if key in found]
    figure = _figure(4.6 * len(maps), 4.4)
    for number, (name, points) in enumerate(maps, start=1):
        axes = figure.add_subplot(1, len(maps), number)
        axes.scatter(points[:, 0], points[:, 1], c=np.array(found["clip"]), cmap="gist_rainbow", s=8)
        axes.set_title(name, fontsize=10)
        axes.set(xticks=[], yticks=[])
    return figure


def _history(results: dict[str, Any], curves: dict[str, Any], history: list[dict[str, str]]) -> Any:
    """Coverage against samples, from the untrained policy on; of the evaluations under the present conditions."""
    alike = [
        row
        for row in history
        if "coverage" in row and all(row[name] == str(results[name]) for name in ("trajectories", "seed", "start"))
    ]
    if len({row["samples"] for row in alike}) < 2:
        return None
    figure = _figure()
    axes = _axes(figure)
    untrained = results["metrics"].get("coverage", {}).get("figures", {})
    # both show where they are one: of few trajectories
    for name, colour, style in (("coverage", _COLOURS[TRAINED], "-"), ("coverage_10", "#7aa6d1", "--")):
        values = untrained.get(name, {}).get("values", {})
        begun = [(0.0, values[UNTRAINED]["value"])] if UNTRAINED in values else []
        points = np.array(begun + [(float(row["samples"]), float(row[name])) for row in alike])
        label = "coverage" if name == "coverage" else "filtered at 10 %"
        axes.plot(points[:, 0], 100 * points[:, 1], color=colour, linestyle=style, marker="o", label=label)
    axes.set(xlabel="samples", ylabel="coverage [%]", ylim=(0, 103))
    axes.legend(frameon=False)
    return figure


def _name(set_ticks: Callable[..., Any], names: Any, rotation: float = 0.0) -> None:
    """Put the clips' names along an axis, where they fit."""
    if len(names) <= _NAMED:
        set_ticks(np.arange(len(names)), names, rotation=rotation, fontsize=6)
    else:
        set_ticks([])


_Draw = Callable[[dict[str, Any], dict[str, Any], list[dict[str, str]]], Any]
_PICTURES: dict[str, tuple[str, _Draw]] = {
    "coverage": ("Coverage against the filtering rate", _coverage),
    "frequencies": ("How often each clip is matched", _frequencies),
    "obeyed": ("What each command is seen as", _obeyed),
    "transitions": ("Probability of the clip after a change of command, given the one before", _transitions),
    "paths": ("Root paths of the skills that vary most, seen from their start", _paths),
    "latents": ("Encodings of windows of the clips, a colour a clip", _maps),
    "distances": ("Distance of the clips' encodings", _distances),
    "history": ("Coverage against training samples", _history),
}
