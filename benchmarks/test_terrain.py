"""What uneven ground costs: beside flat ground in turns, and the share of a step that looking at the ground takes."""

import time
from statistics import median
from typing import Any

import pytest

from benchmarks.conftest import Effort
from benchmarks.record import Figure, Record
from murmillo.cli.benching.stepping import ENVIRONMENT, Stepping, make_warm, physics_of
from murmillo.cli.benching.turns import Rates, rate_of, ratio_of
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.registration import env_config, make_task

WORLDS = 512
GROUNDS = ("flat", "rough")
MOST = 0.15
"""The share of a step that sampling the heights may take."""
_SHARE = "looking at the ground / step"


class Looking(Stepping):
    """Steps on the ground of one kind, and the share of them that goes into looking at it."""

    def __init__(self, env: HumanoidVectorEnv, label: str) -> None:
        super().__init__(env, steps=2, label=label)
        self._seconds = 0.0
        self._look = env._observer._look
        env._observer._look = self._timed_look  # type: ignore[method-assign]

    def turn(self) -> Rates:
        self._seconds = 0.0
        rates = super().turn()
        step_seconds = self.env.num_envs * self.steps / rates[ENVIRONMENT + self.label]
        return {**rates, _SHARE + self.label: self._seconds / step_seconds}

    def _timed_look(self, *arguments: Any) -> None:
        begin = time.perf_counter()
        self._look(*arguments)
        self._seconds += time.perf_counter() - begin


@pytest.mark.gate
def test_rough_ground(benchmark: Any, effort: Effort, record: Record) -> None:
    """`Navigate` on rough ground and on flat ground."""
    worlds = effort.worlds(WORLDS)
    contestants = {
        kind: Looking(make_warm(worlds, env_config("Navigate", terrain=kind), make_task("Navigate")), f", {kind}")
        for kind in GROUNDS
    }
    rounds = effort.run(benchmark, [*contestants.values()], rounds=15)
    for kind, contestant in contestants.items():
        rate, note = rate_of(rounds, f"{ENVIRONMENT}, {kind}"), f"{worlds} worlds"
        physics = physics_of(contestant.env)
        record.figures.append(Figure(f"{ENVIRONMENT}, Navigate, {kind} ground", rate, "control steps/s", note, physics))
        contestant.close()
    share = median(rates[f"{_SHARE}, rough"] for rates in rounds)
    record.figures.append(Figure(_SHARE, share, "", f"rough ground, {worlds} worlds"))
    record.ratios["Navigate, rough ground / flat"] = ratio_of(rounds, f"{ENVIRONMENT}, rough", f"{ENVIRONMENT}, flat")
    assert effort.quick or share <= MOST
