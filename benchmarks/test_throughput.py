"""Control steps a second: bare physics, the suite, and other people's environments, in one run side by side.

A control step of this character is four substeps of 1/120 s. Gymnasium's and EnvPool's Humanoid has 23 degrees of
freedom to our 37 and takes five substeps of 1/333 s; the comparison is per control step.
"""

import os
import resource
import subprocess
import sys
import warnings
from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
import torch

from benchmarks.conftest import BARE
from benchmarks.workload import NOISE, bare_steps_per_second, make_env, noise

WORLDS = 1024


def test_bare_mj_step(benchmark, record):
    """mj_step alone, one process a CPU; measures its own rate, since the processes' start must not count."""
    rates = []
    benchmark.pedantic(lambda: rates.append(bare_steps_per_second()), rounds=3, iterations=1)
    record(BARE, sorted(rates)[1] * benchmark.stats.stats.median, "37 DoF, 4 substeps, starts and actions as below")


def test_physics(benchmark, record):
    env = make_env(WORLDS)
    targets = env.character.targets(torch.from_numpy(noise((WORLDS, 31), 0)).double())
    steps = iter(range(10**9))

    def step() -> None:
        if next(steps) % 20 == 0:
            env.reset()
        else:
            env.physics.step(targets)

    benchmark.pedantic(step, rounds=60, iterations=1, warmup_rounds=1)
    record("physics step", WORLDS, f"{WORLDS} worlds, derived fields of the new state included")


@pytest.mark.parametrize("worlds", [64, WORLDS])
def test_environment(benchmark, record, worlds):
    env = make_env(worlds)
    actions = noise((worlds, 31), 0)
    benchmark.pedantic(lambda: env.step(actions), rounds=100, iterations=1, warmup_rounds=5)
    record("environment step", worlds, f"{worlds} worlds: observations, windows of 10, resets, final_obs")


def test_rollout(benchmark, record):
    runner = training("smoke", WORLDS)
    runner._collect()
    benchmark.pedantic(runner._collect, rounds=3, iterations=1)
    record("rollout", runner.config.horizon * WORLDS, f"{WORLDS} worlds: environment, policy, storage")


@pytest.mark.parametrize("budget", ["smoke", "laptop", "paper"])
def test_training_iteration(benchmark, record, budget):
    """The paper's 131,072 samples an iteration are divided by 16 here; networks and minibatch share are its own."""
    runner = training(budget)
    limit = runner.config
    limit.samples = runner.env.num_envs * limit.horizon
    runner.run()

    def iteration() -> None:
        limit.samples += runner.env.num_envs * limit.horizon
        runner.run()

    benchmark.pedantic(iteration, rounds=3 if budget != "paper" else 1, iterations=1)
    record(f"training iteration, {budget}", runner.env.num_envs * limit.horizon, f"{runner.env.num_envs} worlds")


@pytest.mark.parametrize("kind", ["sync", "async"])
def test_gymnasium_humanoid(benchmark, record, kind):
    worlds = 16
    env = gymnasium.make_vec("Humanoid-v5", num_envs=worlds, vectorization_mode=kind)
    _step_foreign(benchmark, env)
    record(f"gymnasium Humanoid-v5, {kind}", worlds, f"{worlds} worlds")


def test_envpool_humanoid(benchmark, record):
    envpool = pytest.importorskip("envpool", reason="EnvPool is not installed (pip install envpool)")
    worlds = 64
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = envpool.make_gymnasium("Humanoid-v4", num_envs=worlds, num_threads=os.cpu_count())
    _step_foreign(benchmark, env, (worlds, 17))
    record("EnvPool Humanoid-v4", worlds, f"{worlds} worlds, {os.cpu_count()} threads")


def test_memory_of_1024_worlds():
    """Peak memory of a process that trains in 1,024 worlds."""
    code = (
        "from benchmarks.workload import make_env, noise; env = make_env(1024)\n"
        "for step in range(20): env.step(noise((1024, 31), step))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    print(f"\npeak memory with 1,024 worlds: {peak:.2f} GiB")
    assert peak < 2.0


def _step_foreign(benchmark: Callable, env, shape: tuple[int, ...] | None = None) -> None:
    env.reset()
    shape = shape or env.action_space.shape
    actions = np.random.default_rng(0).uniform(-NOISE, NOISE, shape)
    benchmark.pedantic(lambda: env.step(actions), rounds=200, iterations=1, warmup_rounds=20)
    env.close()
