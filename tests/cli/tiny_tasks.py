"""Runs of tasks that take a second or two, and what they log."""

import csv
from pathlib import Path

TINY_TASK = (
    "num_envs=4",
    "runner.horizon=4",
    "runner.samples=32",
    "agent.ppo.hidden=[16]",
    "agent.ppo.minibatch=8",
    "agent.ppo.epochs=1",
    "threads=1",
    "env.episode_steps=12",
    "run.measured_worlds=2",
    "run.video=false",
)
"""Two iterations."""


def rows(folder: Path) -> list[dict[str, str]]:
    """What a run has logged, an iteration a row."""
    with (folder / "scalars.csv").open(newline="") as file:
        return list(csv.DictReader(file))
