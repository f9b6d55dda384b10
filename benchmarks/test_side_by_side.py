"""What is compared runs in turns, so that all meet the same machine: environments with each other, agents with ASE.

A shared machine's speed drifts by more than what is compared: each round lets every contestant run for a second, and
the ratios are taken within the rounds. A control step of this character is four substeps of 1/120 s; Gymnasium's and
EnvPool's Humanoid has 23 degrees of freedom to our 37 and takes five substeps of 1/333 s.
"""

import importlib
import importlib.util
import os
import time
import warnings
from collections.abc import Callable, Iterator
from statistics import median
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from benchmarks.conftest import BARE, Figure
from benchmarks.workload import NOISE, WARM_UP, BareSimulation, iterate, make_env, make_runner, noise
from murmillo.envs.registration import make_task
from murmillo.envs.tasks import TASKS

WORLDS = 1024
ROUNDS = 9
STEPS = 12
ENVIRONMENT = "environment step"


class Ours:
    """The environment as ASE trains on it, and the bare simulation through the states of its last turn."""

    def __init__(self) -> None:
        self._env = make_env(WORLDS)
        self._bare = BareSimulation(self._env.character)
        self._visited: list[list[np.ndarray]] = []
        self._physics_seconds = 0.0
        self._count = WARM_UP
        step_physics = self._env.physics.step

        def timed(*arguments: torch.Tensor) -> None:
            begin = time.perf_counter()
            step_physics(*arguments)
            self._physics_seconds += time.perf_counter() - begin

        self._env.physics.step = timed  # type: ignore[method-assign]

    def turn(self) -> dict[str, float]:
        self._visited.clear()
        self._physics_seconds = seconds = 0.0
        for _ in range(STEPS):
            action = noise((WORLDS, self._env.character.action_dim), self._count)
            self._count += 1
            state = self._env.physics.state_dict()
            targets = self._env.character.targets(torch.from_numpy(action).double())
            self._visited.append([x.numpy() for x in (state["qpos"], state["qvel"], state["qacc_warmstart"], targets)])
            begin = time.perf_counter()
            self._env.step(action)
            seconds += time.perf_counter() - begin
        samples = WORLDS * STEPS
        return {
            BARE: self._bare.rate(self._visited),
            "physics step": samples / self._physics_seconds,
            ENVIRONMENT: samples / seconds,
        }

    def close(self) -> None:
        self._bare.close()
        self._env.close()


class Foreign:
    """Another suite's environment under noise, in its worlds' own course of falls and resets."""

    def __init__(self, name: str, env: Any, worlds: int, steps: int) -> None:
        self.name, self._env, self._worlds, self._steps = name, env, worlds, steps
        self._actions = np.random.default_rng(0).uniform(-NOISE, NOISE, (worlds, 17))
        env.reset()
        for _ in range(20):
            env.step(self._actions)

    def turn(self) -> dict[str, float]:
        begin = time.perf_counter()
        for _ in range(self._steps):
            self._env.step(self._actions)
        return {self.name: self._worlds * self._steps / (time.perf_counter() - begin)}

    def close(self) -> None:
        self._env.close()


@pytest.fixture
def contestants() -> Iterator[list[Ours | Foreign]]:
    made: list[Ours | Foreign] = [Ours()]
    for kind in ("sync", "async"):
        env = gymnasium.make_vec("Humanoid-v5", num_envs=16, vectorization_mode=kind)
        made.append(Foreign(f"gymnasium Humanoid-v5, {kind}", env, 16, 60))
    if importlib.util.find_spec("envpool"):
        made.append(Foreign("EnvPool Humanoid-v4", _envpool(64), 64, 60))
    yield made
    for contestant in made:
        contestant.close()


def test_side_by_side(benchmark: Any, contestants: list[Ours | Foreign], record: Callable[[Figure], None]) -> None:
    """One round is a turn of each; EnvPool takes part where it is installed (pip install envpool)."""
    rounds: list[dict[str, float]] = []

    def one() -> None:
        rounds.append({name: rate for contestant in contestants for name, rate in contestant.turn().items()})

    benchmark.pedantic(one, rounds=ROUNDS, iterations=1, warmup_rounds=0)
    benchmark.extra_info["rounds"] = rounds
    for name in rounds[0]:
        shares = sorted(turn[name] / turn[BARE] for turn in rounds)
        factors = sorted(turn[ENVIRONMENT] / turn[name] for turn in rounds)
        note = f"{WORLDS} worlds" if name in (ENVIRONMENT, "physics step") else ""
        record(Figure(name, median(turn[name] for turn in rounds), note, _spread(shares), _spread(factors)))


def test_training_side_by_side(benchmark: Any, record: Callable[[Figure], None]) -> None:
    """An iteration of each agent in turn, with the networks of `smoke`, which are the same."""
    runners = {agent: make_runner("smoke", f"agent={agent}") for agent in ("ase", "case", "calm")}
    rounds: list[dict[str, float]] = []

    def one() -> None:
        rates = {}
        for agent, runner in runners.items():
            begin = time.perf_counter()
            iterate(runner)
            rates[agent] = runner.env.num_envs * runner.config.horizon / (time.perf_counter() - begin)
        rounds.append(rates)

    benchmark.pedantic(one, rounds=5, iterations=1, warmup_rounds=1)
    for agent in runners:
        ratios = sorted(turn[agent] / turn["ase"] for turn in rounds[1:])
        rate = median(turn[agent] for turn in rounds[1:])
        record(Figure(f"training iteration, {agent}, smoke", rate, "samples", of_ase=_spread(ratios)))


def test_tasks_side_by_side(benchmark: Any, record: Callable[[Figure], None]) -> None:
    """A step of every task's environment in turn; what is said is its rate over the imitation environment's."""
    envs = {name: make_env(WORLDS, make_task(name)) for name in TASKS}
    counts = iter(range(WARM_UP, 10**9))
    rounds: list[dict[str, float]] = []

    def one() -> None:
        action = noise((WORLDS, 31), next(counts))
        rates = {}
        for name, env in envs.items():
            begin = time.perf_counter()
            env.step(action)
            rates[name] = WORLDS / (time.perf_counter() - begin)
        rounds.append(rates)

    benchmark.pedantic(one, rounds=20, iterations=1, warmup_rounds=1)
    for name in envs:
        ratios = sorted(turn[name] / turn["Imitation"] for turn in rounds[1:])
        rate = median(turn[name] for turn in rounds[1:])
        record(Figure(f"environment step, {name}", rate, f"of Imitation's: {_spread(ratios)}"))
        envs[name].close()


def _spread(ratios: list[float]) -> str:
    """Median and range of ratios in order."""
    return f"{median(ratios):.2f} ({ratios[0]:.2f}-{ratios[-1]:.2f})"


def _envpool(worlds: int) -> Any:
    envpool = importlib.import_module("envpool")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return envpool.make_gymnasium("Humanoid-v4", num_envs=worlds, num_threads=os.cpu_count())
