"""Control steps a second: bare physics, the suite, and other people's environments, in one run side by side.

A control step of this character is four substeps of 1/120 s. Gymnasium's and EnvPool's Humanoid has 23 degrees of
freedom to our 37 and takes five substeps of 1/333 s; the comparison is per control step.
"""

import os
import subprocess
import sys
import time
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from benchmarks.conftest import BARE
from benchmarks.workload import NOISE, bare_steps_per_second, make_env, make_runner, noise

WORLDS = 1024
PAPER_EIGHTH = (
    "num_envs=512",
    "agent.ppo.minibatch=2048",
    "agent.discriminator.minibatch=512",
    "agent.discriminator.replay_size=25000",
)


def test_bare_mj_step(benchmark, record):
    """mj_step alone, one process a CPU; it takes its own time, since the processes' start must not count."""
    rates: list[float] = []
    benchmark.pedantic(lambda: rates.append(bare_steps_per_second(WORLDS)), rounds=3, iterations=1)
    record(BARE, sorted(rates)[1], "37 DoF, 4 substeps, through the states that the environment visits")


def test_physics(benchmark, record):
    """The part of the environment's step that is MuJoCo's."""
    env = make_env(WORLDS)
    seconds: list[float] = []
    step_physics = env.physics.step

    def timed(*arguments: torch.Tensor) -> None:
        begin = time.perf_counter()
        step_physics(*arguments)
        seconds.append(time.perf_counter() - begin)

    env.physics.step = timed  # type: ignore[method-assign]
    seeds = iter(range(10**9))
    benchmark.pedantic(lambda: env.step(noise((WORLDS, 31), next(seeds))), rounds=40, iterations=1)
    record("physics step", WORLDS / sorted(seconds)[len(seconds) // 2], f"{WORLDS} worlds, derived fields up to date")


@pytest.mark.parametrize("worlds", [64, WORLDS])
def test_environment(benchmark, record, worlds):
    env = make_env(worlds)
    seeds = iter(range(10**9))
    benchmark.pedantic(lambda: env.step(noise((worlds, 31), next(seeds))), rounds=60, iterations=1)
    note = f"{worlds} worlds: observations, windows of 10, resets, final_obs"
    record("environment step", worlds / benchmark.stats.stats.median, note)


def test_rollout(benchmark, record):
    runner = make_runner("smoke", num_envs=WORLDS)
    runner._collect()
    benchmark.pedantic(runner._collect, rounds=3, iterations=1)
    samples = runner.config.horizon * WORLDS
    record("rollout", samples / benchmark.stats.stats.median, f"{WORLDS} worlds: environment, policy, storage")


@pytest.mark.parametrize(
    ("agent", "budget"), [("ase", "smoke"), ("case", "smoke"), ("calm", "smoke"), ("ase", "laptop"), ("ase", "paper")]
)
def test_training_iteration(benchmark, record, agent, budget):
    """`paper` with an eighth of its worlds and minibatches, 16,384 samples instead of 131,072, and its own networks."""
    runner = make_runner(budget, f"agent={agent}", *(PAPER_EIGHTH if budget == "paper" else ()))
    samples = runner.env.num_envs * runner.config.horizon

    def iteration() -> None:
        runner._direct()
        rollout = runner._collect()
        runner._reward(rollout)
        runner._advantage(rollout)
        runner.agent.update(rollout)

    iteration()
    benchmark.pedantic(iteration, rounds=1 if budget == "paper" else 5, iterations=1)
    note = f"{runner.env.num_envs} worlds, {samples:,} samples an iteration"
    record(f"training iteration, {agent}, {budget}", samples / benchmark.stats.stats.median, note)


@pytest.mark.parametrize("kind", ["sync", "async"])
def test_gymnasium_humanoid(benchmark, record, kind):
    worlds = 16
    env = gymnasium.make_vec("Humanoid-v5", num_envs=worlds, vectorization_mode=kind)
    record(f"gymnasium Humanoid-v5, {kind}", worlds / _step_foreign(benchmark, env), f"{worlds} worlds")


def test_envpool_humanoid(benchmark, record):
    envpool = pytest.importorskip("envpool", reason="EnvPool is not installed (pip install envpool)")
    worlds = 64
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = envpool.make_gymnasium("Humanoid-v4", num_envs=worlds, num_threads=os.cpu_count())
    seconds = _step_foreign(benchmark, env, (worlds, 17))
    record("EnvPool Humanoid-v4", worlds / seconds, f"{worlds} worlds, {os.cpu_count()} threads")


def test_memory_of_1024_worlds(benchmark, record):
    """Peak memory of a process that steps 1,024 worlds."""
    code = (
        "import resource; from benchmarks.workload import make_env; make_env(1024)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)"
    )
    peak = benchmark.pedantic(subprocess.check_output, args=([sys.executable, "-c", code],), rounds=1, iterations=1)
    benchmark.extra_info["peak_bytes"] = int(peak)
    record("peak memory [MB]", int(peak) / 1e6, f"{WORLDS} worlds, the environment's process")


def _step_foreign(benchmark: Any, env: Any, shape: tuple[int, ...] | None = None) -> float:
    """Seconds of a step under noise, in the worlds' own course of falls and resets."""
    env.reset()
    actions = np.random.default_rng(0).uniform(-NOISE, NOISE, shape or env.action_space.shape)
    benchmark.pedantic(lambda: env.step(actions), rounds=200, iterations=1, warmup_rounds=20)
    env.close()
    return benchmark.stats.stats.median
