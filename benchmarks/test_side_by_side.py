"""The environment beside bare MuJoCo and the environments of others, and the tasks beside each other.

A control step of our character is four substeps of 1/120 s with 37 degrees of freedom; Gymnasium's and EnvPool's
Humanoid has 23 and takes five substeps of 1/333 s. Each takes a turn of about a second in every round.
"""

from typing import Any

import pytest

from benchmarks.bare import BARE, ROLLOUT, Visiting
from benchmarks.conftest import Effort
from benchmarks.foreign import SUITES, Foreign
from benchmarks.record import Figure, Record
from murmillo.cli.benching.stepping import ENVIRONMENT, PHYSICS, Stepping, make_warm, physics_of
from murmillo.cli.benching.turns import rate_of, ratio_of
from murmillo.envs.registration import env_config, make_task
from murmillo.envs.tasks import TASKS

WORLDS = 1024


@pytest.mark.gate
def test_environments(benchmark: Any, effort: Effort, record: Record) -> None:
    """Gymnasium and EnvPool take part where they are installed (pip install envpool)."""
    ours = Visiting(make_warm(effort.worlds(WORLDS)), steps=12)
    others = []
    for name, suite in SUITES.items():
        if (reason := suite.why_not()) is not None:
            record.left_out[f"{ENVIRONMENT} / {name}"] = reason
        else:
            others.append(Foreign(name, suite.make(suite.worlds), suite.worlds))
    rounds = effort.run(benchmark, [ours, *others], rounds=9)

    physics, note = physics_of(ours.env), f"{ours.env.num_envs} worlds, all cores"
    for name in (BARE, ROLLOUT, PHYSICS, ENVIRONMENT):
        record.figures.append(Figure(name, rate_of(rounds, name), "control steps/s", note, physics))
    for other in others:
        rate, worlds = rate_of(rounds, other.name), f"{other.worlds} worlds"
        record.figures.append(Figure(other.name, rate, "control steps/s", worlds, other.physics()))
    record.ratios[f"{PHYSICS} / {BARE}"] = ratio_of(rounds, PHYSICS, BARE)
    for name in (BARE, ROLLOUT, *(other.name for other in others)):
        record.ratios[f"{ENVIRONMENT} / {name}"] = ratio_of(rounds, ENVIRONMENT, name)
    for contestant in (ours, *others):
        contestant.close()


@pytest.mark.gate
def test_tasks(benchmark: Any, effort: Effort, record: Record) -> None:
    """A step of every task's environment in turn."""
    worlds = effort.worlds(WORLDS)
    contestants = [
        Stepping(make_warm(worlds, env_config(name), make_task(name)), steps=1, label=f", {name}") for name in TASKS
    ]
    rounds = effort.run(benchmark, [*contestants], rounds=15)
    for name, contestant in zip(TASKS, contestants, strict=True):
        step, physics = f"{ENVIRONMENT}, {name}", physics_of(contestant.env)
        record.figures.append(Figure(step, rate_of(rounds, step), "control steps/s", f"{worlds} worlds", physics))
        if name != "Imitation":
            record.ratios[f"{name} / Imitation"] = ratio_of(rounds, step, f"{ENVIRONMENT}, Imitation")
        contestant.close()
