"""What uneven ground costs: beside flat ground in turns, and the share of a step that looking at the ground takes."""

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np

from benchmarks.conftest import Figure
from benchmarks.workload import NOISE
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.registration import make_vector

WORLDS = 512
ROUNDS = 30
MOST = 0.15
"""The share of a step that sampling the heights may take."""


def test_looking_at_the_ground(benchmark: Any, record: Callable[[Figure], None]) -> None:
    """A step on rough ground and one on flat ground in turn, under the same noise."""
    envs = {kind: _make(kind) for kind in ("flat", "rough")}
    looks = _timed_looks(envs["rough"])
    rounds: list[dict[str, float]] = []
    random = np.random.default_rng(0)

    def one() -> None:
        action = random.uniform(-NOISE, NOISE, (WORLDS, 28)).astype(np.float32)
        looks.clear()
        seconds = {}
        for kind, env in envs.items():
            begin = time.perf_counter()
            env.step(action)
            seconds[kind] = time.perf_counter() - begin
        rounds.append(seconds | {"looking": sum(looks)})

    benchmark.pedantic(one, rounds=ROUNDS, iterations=1, warmup_rounds=3)
    measured = rounds[3:]
    share = sorted(turn["looking"] / turn["rough"] for turn in measured)
    of_flat = sorted(turn["flat"] / turn["rough"] for turn in measured)
    notes = {"flat": f"{WORLDS} worlds", "rough": f"{WORLDS} worlds; {median(of_flat):.2f} of flat ground's rate"}
    for kind, note in notes.items():
        rate = WORLDS / median(turn[kind] for turn in measured)
        record(Figure(f"environment step, Navigate, {kind} ground", rate, note))
    note = f"share of the step: {median(share):.3f} ({share[0]:.3f}-{share[-1]:.3f})"
    record(Figure("height maps", WORLDS / median(turn["looking"] for turn in measured), note))
    assert median(share) <= MOST


def _make(kind: str) -> HumanoidVectorEnv:
    env = make_vector("Navigate", WORLDS, terrain=kind)
    env.reset(seed=0)
    return env


def _timed_looks(env: HumanoidVectorEnv) -> list[float]:
    """Seconds of each look at the ground from now on."""
    looks: list[float] = []
    look = env._observer._look

    def timed(*arguments: Any) -> None:
        begin = time.perf_counter()
        look(*arguments)
        looks.append(time.perf_counter() - begin)

    env._observer._look = timed  # type: ignore[method-assign]
    return looks
