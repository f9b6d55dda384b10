"""Checkpoints that a run keeps on its way, by which its figures are followed over the samples."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from murmillo.agents.common import checkpoint
from murmillo.agents.common.runner import Runner
from murmillo.cli import runs

_TRAINING_ALONE = ("latents", "replay")
"""Parts of an agent that are large, and that who plays it makes anew."""


class Keeper:
    """Called after each iteration of a run, it keeps a checkpoint of the first one past every so many samples."""

    def __init__(self, runner: Runner, agent: Any, every: int, folder: Path) -> None:
        """
        Args:
            runner: as it begins, or goes on.
            agent: that it trains.
            every: samples from one checkpoint to the next.
            folder: of the run.
        """
        self._runner, self._agent, self._every, self._folder = runner, agent, every, folder
        self._passed = runner.samples // every

    def __call__(self, scalars: Mapping[str, float]) -> None:
        passed = self._runner.samples // self._every
        if passed == self._passed:
            return
        self._passed = passed
        samples = self._runner.samples
        agent = {name: part for name, part in self._agent.state_dict().items() if name not in _TRAINING_ALONE}
        state = {"meta": self._runner.meta, "agent": agent, "samples": samples}
        if not self._runner.ranks.first:
            return
        checkpoint.save(self._folder / runs.CHECKPOINTS / str(samples), state)


def kept_checkpoints(folder: Path) -> dict[int, Path]:
    """Of the run in `folder`, by their samples, the earliest first."""
    found = {int(path.name): path for path in (folder / runs.CHECKPOINTS).glob("[0-9]*") if path.name.isdecimal()}
    return dict(sorted(found.items()))
