"""What a sample costs with few worlds and many, on one thread and on all, on the CPU and on a GPU."""

import importlib.util
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest
import torch

from benchmarks.conftest import Effort
from benchmarks.record import Figure, Record
from murmillo.cli.benching.measuring import doubling
from murmillo.cli.benching.stepping import ENVIRONMENT, PHYSICS, Stepping, make_warm, physics_of, warm_state
from murmillo.cli.benching.turns import rate_of, ratio_of
from murmillo.cli.versions import usable_cores
from murmillo.envs import EnvConfig
from murmillo.envs.registration import env_config

WORLDS = (64, 256, 1024, 4096, 16384)
FEW = 256
"""What a sample costs with more worlds is compared with this many."""


@pytest.mark.gate
@pytest.mark.parametrize("engine", ["cpu", "warp"])
def test_worlds(benchmark: Any, effort: Effort, record: Record, engine: str) -> None:
    """All sizes take as many samples a turn, in the same states."""
    sizes = sorted({effort.worlds(worlds) for worlds in WORLDS} | {FEW})
    suffix = "" if engine == "cpu" else f", {engine}"
    compared = {worlds: f"{ENVIRONMENT}{suffix}, {worlds} worlds / {FEW}" for worlds in sizes if worlds > FEW}
    if (reason := why_not(engine)) is not None:
        record.left_out |= dict.fromkeys(compared.values(), reason)
        pytest.skip(reason)
    config = env_config(window=10, **({} if engine == "cpu" else {"physics": engine, "tensors": True}))
    state = warm_state(config)
    with ExitStack() as stack:
        contestants = [
            stack.enter_context(stepping(worlds, config, state, max(2, 4096 // worlds), f", {worlds} worlds"))
            for worlds in sizes
        ]
        rounds = effort.run(benchmark, [*contestants], rounds=7)
        physics = physics_of(contestants[0].env)
    for worlds in sizes:
        for name in (PHYSICS, ENVIRONMENT):
            rate = rate_of(rounds, f"{name}, {worlds} worlds")
            record.figures.append(Figure(f"{name}{suffix}", rate, "control steps/s", f"{worlds} worlds", physics))
    for worlds, name in compared.items():
        record.ratios[name] = ratio_of(rounds, f"{ENVIRONMENT}, {worlds} worlds", f"{ENVIRONMENT}, {FEW} worlds")


@pytest.mark.gate
def test_threads(benchmark: Any, effort: Effort, record: Record) -> None:
    """1, 2, 4, … and all cores, each with 1,024 worlds."""
    worlds, counts = effort.worlds(1024), doubling(usable_cores())
    if counts == [1]:
        record.left_out[f"{ENVIRONMENT}, 2 threads / 1"] = "there is one core"
    configs = {threads: env_config(window=10, threads=threads) for threads in counts}
    state = warm_state(configs[1])
    with ExitStack() as stack:
        contestants = [
            stack.enter_context(stepping(worlds, config, state, 2, f", {threads} threads"))
            for threads, config in configs.items()
        ]
        rounds = effort.run(benchmark, [*contestants], rounds=9)
        physics = physics_of(contestants[0].env)
    for threads in counts:
        for name in (PHYSICS, ENVIRONMENT):
            rate, note = rate_of(rounds, f"{name}, {threads} threads"), f"{worlds} worlds, {threads} threads"
            record.figures.append(Figure(name, rate, "control steps/s", note, physics))
        if threads > 1:
            step = f"{ENVIRONMENT}, {threads} threads"
            record.ratios[f"{step} / 1"] = ratio_of(rounds, step, f"{ENVIRONMENT}, 1 threads")


@contextmanager
def stepping(worlds: int, config: EnvConfig, state: Mapping[str, Any], steps: int, label: str) -> Iterator[Stepping]:
    """A contestant that begins in a warm state."""
    contestant = Stepping(make_warm(worlds, config, state=state), steps, label)
    yield contestant
    contestant.close()


def why_not(engine: str) -> str | None:
    """Why a physics engine cannot be measured here."""
    if engine == "cpu":
        return None
    if importlib.util.find_spec("mujoco_warp") is None:
        return "mujoco-warp is not installed"
    return None if torch.cuda.is_available() else "there is no GPU that torch can use"
