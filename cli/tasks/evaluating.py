"""The figures of a run that learned a task, in `evaluation/metrics.json`, where `murmillo compare` reads them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from murmillo.agents.common import checkpoint
from murmillo.cli import runs
from murmillo.cli.blending import NOTHING, Blend
from murmillo.cli.evaluation.identity import checkpoint_digest
from murmillo.cli.tasks import low, table
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.measuring import Measured, measure

SEED = 12345
PROTOCOL = "one episode a world, mean actions"


def evaluate(
    config: TaskTrainConfig, below: LowRun | None, folder: Path, worlds: int, seed: int = SEED
) -> dict[str, Any]:
    """Measure the run in `folder` in so many episodes and keep what was found.

    Returns:
        What `evaluation/metrics.json` has.

    Raises:
        AgentError: there is no checkpoint, or it does not fit.
        CommandError, SuiteError: the low-level run has changed, or the environment cannot be made.
    """
    saved = checkpoint.load(folder / runs.LAST)
    low.check_unchanged(below, saved)
    measured = measure(config, below, folder / runs.LAST, worlds, seed)
    protocols = [PROTOCOL]
    if config.commands_styles:
        protocols.append("one style an episode")
    metrics = {
        "task": {"title": "The task", "protocols": protocols, "figures": table.entries(measured.all)},
        **_styles(measured, protocols),
    }
    return keep(folder, saved, config.choices["task"], config.choices["agent"], worlds, seed, metrics)


def keep(
    folder: Path,
    saved: Mapping[str, Any],
    task: str,
    agent: str,
    worlds: int,
    seed: int,
    metrics: dict[str, Any],
    blend: Blend = NOTHING,
) -> dict[str, Any]:
    """Write `evaluation/metrics.json`, and return what it has.

    Args:
        folder: of the run.
        saved: content of its checkpoint.
        task, agent: their names.
        worlds: episodes that were measured.
        seed: of them.
        metrics: what was found, by metric.
        blend: how its adapters acted; where anything was told, the figures have a place of their own.
    """
    results = {
        "run": folder.name,
        "task": task,
        "agent": agent,
        "samples": int(saved.get("samples", 0)),
        "checkpoint": checkpoint_digest(folder / runs.LAST),
        "trajectories": worlds,
        "seed": seed,
        "start": "as in training",
        "not_comparable": None,
        **blend.identity(),
        "metrics": metrics,
    }
    to = blend.place(folder) / runs.METRICS
    to.parent.mkdir(parents=True, exist_ok=True)
    runs.write_json(to, results)
    return results


def _styles(measured: Measured, protocols: list[str]) -> dict[str, Any]:
    """What `metrics` has of the single styles; nothing where none is commanded."""
    figures: dict[str, Any] = {}
    for style in sorted({style for found in measured.styles.values() for style in found}):
        figures |= table.entries({player: found[style] for player, found in measured.styles.items()}, style)
    return {"styles": {"title": "Style by style", "protocols": protocols, "figures": figures}} if figures else {}
