"""A run that has learned a task, opened to be measured or filmed."""

import dataclasses
from pathlib import Path

from murmillo.agents.common import checkpoint
from murmillo.cli import runs
from murmillo.cli.errors import CommandError
from murmillo.cli.tasks import low as low_runs
from murmillo.cli.tasks.config import TaskTrainConfig, load
from murmillo.cli.tasks.low import LowRun


def open_run(folder: Path, low: str | None, motions: str | None) -> tuple[TaskTrainConfig, LowRun | None]:
    """Its settings and the run below it.

    Args:
        folder: of the run.
        low: where the run below has moved; None where it still is.
        motions: the same of the clips.

    Raises:
        AgentError: there is no checkpoint, or it is damaged.
        CommandError: the settings cannot be read, or the run below is missing or has changed.
    """
    config = load(folder, [f"low={low}"] if low else [])
    if motions is not None:
        config.env = dataclasses.replace(config.env, motions=motions)
    saved = checkpoint.load(folder / runs.LAST)
    try:
        below = low_runs.find(config.low)
    except CommandError as error:
        raise CommandError(f"{error}; where it has moved, low=… tells the place") from None
    low_runs.check_unchanged(below, saved)
    return config, below
