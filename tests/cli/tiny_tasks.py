"""Runs of tasks that take a second or two, and what being taken up again must not change in them."""

from collections.abc import Callable
from pathlib import Path

from tests.cli.running import rows

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


def assert_resumed_as_at_once(murmillo: Callable[..., tuple[int, str, str]], root: Path, *words: str) -> None:
    """Take the run `high` in `root` up again, and train another by these words without a stop: both end alike."""
    for ask in (("run.resume=runs/high",), (*words, *TINY_TASK, "low=runs/low", "run.name=whole")):
        status, _, err = murmillo("train", *ask, "runner.samples=48")
        assert status == 0, err
    resumed, at_once = (rows(root / name)[-1] for name in ("high", "whole"))
    assert resumed.pop("samples_per_second")
    assert at_once.pop("samples_per_second")
    assert resumed == at_once
