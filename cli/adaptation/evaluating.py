"""The figures of a run of AdaptNet, in `evaluation/metrics.json`, where `murmillo compare` reads them."""

from pathlib import Path
from typing import Any

from murmillo.agents.common import checkpoint
from murmillo.cli import runs
from murmillo.cli.adaptation.base import BaseRun
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.measuring import measure
from murmillo.cli.adaptation.world import check_base
from murmillo.cli.blending import NOTHING, Blend
from murmillo.cli.tasks import table
from murmillo.cli.tasks.evaluating import PROTOCOL, SEED, keep


def evaluate(
    config: AdaptNetTrainConfig,
    base: BaseRun | None,
    folder: Path,
    worlds: int,
    seed: int = SEED,
    blend: Blend = NOTHING,
) -> dict[str, Any]:
    """Measure the run in `folder` in so many episodes and keep what was found; of a blend, at its own place.

    Returns:
        What `evaluation/metrics.json` has.

    Raises:
        AgentError: there is no checkpoint, or it does not fit.
        CommandError, SuiteError: the base has changed, or the environment cannot be made.
    """
    saved = checkpoint.load(folder / runs.LAST)
    check_base(base, saved)
    figures = table.entries(measure(config, base, folder, worlds, seed, blend))
    metrics = {"task": {"title": "Goal and style", "protocols": [PROTOCOL], "figures": figures}}
    return keep(folder, saved, "navigate", config.choices["agent"], worlds, seed, metrics, blend)
