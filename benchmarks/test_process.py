"""What a process takes: memory, and time until it does something. Each is measured in processes of its own."""

import subprocess
import sys
import time
from typing import Any

import pytest

from benchmarks.conftest import Effort
from benchmarks.record import Figure, Record
from murmillo.cli.benching.turns import Rates, Spread, rate_of, ratio_of

_STEP = """\
import numpy
from murmillo.envs.registration import make_vector
env = make_vector("Imitation", {worlds}, window=10)
env.reset(seed=0)
env.step(numpy.zeros(env.action_space.shape, numpy.float32))
"""
_TRAIN = """\
from murmillo.cli.benching.learning import Learning, compose
Learning(compose(["agent={agent}", "budget=laptop"])).turn()
"""
_PEAK = "from murmillo.cli.benching.memory import peak_memory\nprint(peak_memory())\n"

HELP = "murmillo --help"
STEP = "import to first step"
LIBRARIES = "import of mujoco, torch and gymnasium"
STARTS = {
    "python": ("-c", "pass"),
    HELP: ("-m", "murmillo.cli.main", "--help"),
    LIBRARIES: ("-c", "import mujoco, torch, gymnasium"),
    STEP: ("-c", _STEP.format(worlds=1)),
}


class Start:
    """A program that is run from its cold start to its end; a contestant."""

    def __init__(self, name: str) -> None:
        self.name = name

    def turn(self) -> Rates:
        begin = time.perf_counter()
        subprocess.run([sys.executable, *STARTS[self.name]], check=True, stdout=subprocess.DEVNULL)
        return {self.name: 1 / (time.perf_counter() - begin)}


@pytest.mark.gate
def test_cold_start(benchmark: Any, effort: Effort, record: Record) -> None:
    """Seconds of whole processes, the interpreter's start among them, their files in the disk's cache."""
    rounds = effort.run(benchmark, [Start(name) for name in STARTS], rounds=5)
    for name in STARTS:
        record.figures.append(Figure(f"cold start: {name}", 1 / rate_of(rounds, name), "s"))
    record.ratios[f"cold start: {STEP} / {LIBRARIES}"] = ratio_of(rounds, STEP, LIBRARIES)
    record.ratios[f"cold start: {HELP} / python"] = ratio_of(rounds, HELP, "python")


@pytest.mark.gate
def test_memory_of_environments(benchmark: Any, effort: Effort, record: Record) -> None:
    """Peak memory of processes that step few worlds and many."""
    few, many = effort.worlds(64), effort.worlds(4096)
    codes = {worlds: _STEP.format(worlds=worlds) + _PEAK for worlds in (few, many)}
    found = benchmark.pedantic(lambda: {worlds: peak_of(code) for worlds, code in codes.items()}, rounds=1)
    for worlds, peak in found.items():
        record.figures.append(Figure("peak memory of the environment", peak / 1e6, "MB", f"{worlds} worlds"))
    record.ratios[f"peak memory: {few} worlds / {many}"] = Spread.of([found[few] / found[many]])


@pytest.mark.parametrize("agent", ["ase", "calm", "case", "adaptnet"])
def test_memory_of_training(benchmark: Any, record: Record, agent: str) -> None:
    """Peak memory of a process that trains for an iteration of `laptop`."""
    peak = benchmark.pedantic(peak_of, args=(_TRAIN.format(agent=agent) + _PEAK,), rounds=1)
    record.figures.append(Figure(f"peak memory of training, {agent}, laptop", peak / 1e6, "MB"))


def peak_of(code: str) -> int:
    """[bytes] that Python code prints at its end."""
    return int(subprocess.check_output([sys.executable, "-c", code]).split()[-1])
