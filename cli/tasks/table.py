"""The figures of a task: what each is called, which way is good, and the tables that show them."""

import math
from typing import Any

from murmillo.cli.evaluation.figures import Value
from murmillo.cli.evaluation.table import FigureKind
from murmillo.cli.tasks.players import PLAYERS, TRAINED

_KINDS = {
    kind.name: kind
    for kind in (
        FigureKind("normalised_return", "Normalised return", "", 3, "up"),
        FigureKind("reach_error", "Distance of the sword's tip from the target", "m", 3, "down"),
        FigureKind("heading_cosine", "Cosine of movement and its direction", "", 3, "up"),
        FigureKind("goal_reward", "Goal reward", "", 3, "up"),
        FigureKind("imitation_error", "Imitation error", "m", 3, "down"),
        FigureKind("style_success", "Steps in the commanded style", "%", 1, "up"),
        FigureKind("length", "Episode length", "steps", 1, "up"),
        FigureKind("fall_rate", "Fall rate", "%", 1, "down"),
        FigureKind("early_rate", "Episodes that ended early", "%", 1, "down"),
    )
}
MEANINGS = {
    "normalised_return": "the reward of an episode's steps, 0 the least and 1 the most that the task can give; the "
    "steps after an early end count as 0 (ASE, table 1). ± is the deviation of single episodes.",
    "reach_error": "over all control steps, the way there included. ASE reports 0.088 ± 0.046 m (section 10.2).",
    "heading_cosine": "1 is straight where it was told to move, -1 straight away, 0 for standing still. CALM reports "
    "0.91 to 0.92 (table 2).",
    "goal_reward": "the task's reward of a control step, 0 to 1, mean over the steps until an episode's end: what "
    "AdaptNet's learning curves show.",
    "imitation_error": "mean distance of the links, relative to the root and its heading, from the nearest clip "
    "(AdaptNet, eq. 15): the motion is cut into pieces as long as the clip, which is taken for a cycle, and time is "
    "warped; half a second at least. ± is the deviation of single pieces.",
    "style_success": "share of the control steps that lie nearest, of all clips (ASE, eq. 22), to one of the commanded "
    "skill, which holds for an episode. CALM asked human raters instead, who saw running in 100 %, walking in 81 % and "
    "walking crouched in 94 % (table 2): no figures to set beside this one.",
    "length": "control steps (30 a second) to a fall, an end of the task's own or the clock.",
    "fall_rate": "share of the episodes that ended by a fall.",
    "early_rate": "share that ended before the clock: falls, and what the task forbids.",
}
_ARROWS = {"up": " ↑", "down": " ↓", "": ""}
_PUBLISHED = {
    "reach": ("0.75 ± 0.01", "0.56 ± 0.11"),
    "speed": ("0.93 ± 0.01", "0.95 ± 0.01"),
    "steering": ("0.90 ± 0.01", "0.94 ± 0.01"),
    "location": ("0.45 ± 0.01", "0.67 ± 0.01"),
    "strike": ("0.82 ± 0.01", "0.87 ± 0.01"),
}
"""Normalised returns of ASE's table 1: over its low-level policies, and from scratch; ± over three models."""


def columns(results: dict[str, Any]) -> list[str]:
    """Titles of the table's columns: the figure, then who played."""
    return ["", *(PLAYERS[name] for name in PLAYERS if name in _players(results))]


def rows(results: dict[str, Any], spread: bool = True) -> list[list[str]]:
    """A row a figure."""
    shown = [name for name in PLAYERS if name in _players(results)]
    lines = []
    for name, figure in _figures(results).items():
        kind = _KINDS[name]
        found = [figure["values"].get(player, {}) for player in shown]
        cells = [kind.show(value.get("value"), value.get("spread") if spread else None) for value in found]
        lines.append([kind.title + _ARROWS[kind.better], *cells])
    return lines


def markdown(results: dict[str, Any]) -> str:
    """The table."""
    return _markdown(columns(results), rows(results))


def styles_markdown(results: dict[str, Any]) -> str:
    """The trained policy's figures in each style, as CALM's table 2 has them; empty where no style is commanded."""
    figures = results["metrics"].get("styles", {}).get("figures", {})
    if not figures:
        return ""
    names, styles = (list(dict.fromkeys(part)) for part in zip(*(key.split(".", 1) for key in figures), strict=True))
    values = {key: figure["values"].get(TRAINED, {}).get("value") for key, figure in figures.items()}
    lines = [[style, *(_KINDS[name].show(values.get(f"{name}.{style}")) for name in names)] for style in styles]
    return _markdown(["style", *(_KINDS[name].title + _ARROWS[_KINDS[name].better] for name in names)], lines)


def meanings(results: dict[str, Any]) -> str:
    """What the figures that there are mean, a line each."""
    return "\n".join(f"- **{_KINDS[name].title}**: {MEANINGS[name]}" for name in _figures(results))


def entries(measured: dict[str, dict[str, Value]], style: str | None = None) -> dict[str, Any]:
    """The figures of all players as `evaluation/metrics.json` has those of a metric; with `style`, those of a style."""
    return {
        (name if style is None else f"{name}.{style}"): {
            "title": kind.title if style is None else f"{kind.title}: {style}",
            "unit": kind.unit,
            "better": kind.better,
            "values": {player: _finite(found[name]) for player, found in measured.items() if name in found},
        }
        for name, kind in _KINDS.items()
        if any(name in found for found in measured.values())
    }


def by_player(results: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Figures by player and name, and how many episodes they are of, as `measures.json` has them."""
    measures: dict[str, dict[str, float]] = {}
    for name, figure in _figures(results).items():
        for player, value in figure["values"].items():
            measures.setdefault(player, {"episodes": results["trajectories"]})[name] = value["value"]
    return measures


def published(task: str) -> str:
    """What ASE reports of this task, in a sentence; empty where it has none of that name."""
    if task not in _PUBLISHED:
        return ""
    over, scratch = _PUBLISHED[task]
    return (
        f"ASE reports a normalised return of {over} over its low-level policies and {scratch} from scratch (table 1), "
        "in another simulator, with other clips and after billions of samples."
    )


def _markdown(heads: list[str], lines: list[list[str]]) -> str:
    table = [heads, ["---", *["---:"] * (len(heads) - 1)], *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in table)


def _finite(value: Value) -> dict[str, Any]:
    """As JSON has it, which knows no NaN."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in value._asdict().items()}


def _figures(results: dict[str, Any]) -> dict[str, Any]:
    return results["metrics"]["task"]["figures"]


def _players(results: dict[str, Any]) -> set[str]:
    return {player for figure in _figures(results).values() for player in figure["values"]}
