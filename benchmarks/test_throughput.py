"""What the suite does in a second: environment, rollout, training iterations; and what memory it takes."""

import subprocess
import sys

import pytest

from benchmarks.conftest import Figure
from benchmarks.workload import iterate, make_env, make_runner, noise

WORLDS = 1024
PAPER_EIGHTH = (
    "num_envs=512",
    "agent.ppo.minibatch=2048",
    "agent.discriminator.minibatch=512",
    "agent.discriminator.replay_size=25000",
)


def test_environment_of_64_worlds(benchmark, record):
    env = make_env(64)
    seeds = iter(range(10**9))
    benchmark.pedantic(lambda: env.step(noise((64, 31), next(seeds))), rounds=60, iterations=1)
    record(Figure("environment step, 64 worlds", 64 / benchmark.stats.stats.median))


def test_rollout(benchmark, record):
    runner = make_runner("smoke", num_envs=WORLDS)
    runner._collect()
    benchmark.pedantic(runner._collect, rounds=3, iterations=1)
    samples = runner.config.horizon * WORLDS
    rate = samples / benchmark.stats.stats.median
    record(Figure("rollout", rate, f"{WORLDS} worlds: environment, policy, storage"))


@pytest.mark.parametrize("budget", ["laptop", "paper"])
def test_training_iteration(benchmark, record, budget):
    """`paper` with an eighth of its worlds and minibatches, 16,384 samples instead of 131,072, and its own networks."""
    runner = make_runner(budget, "agent=ase", *(PAPER_EIGHTH if budget == "paper" else ()))
    samples = runner.env.num_envs * runner.config.horizon
    iterate(runner)
    benchmark.pedantic(iterate, args=(runner,), rounds=1 if budget == "paper" else 5, iterations=1)
    note = f"{runner.env.num_envs} worlds, {samples:,} samples an iteration"
    record(Figure(f"training iteration, ase, {budget}", samples / benchmark.stats.stats.median, note))


def test_memory_of_1024_worlds(benchmark, record):
    """Peak memory of a process that steps 1,024 worlds."""
    code = (
        "import resource; from benchmarks.workload import make_env; make_env(1024)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)"
    )
    peak = benchmark.pedantic(subprocess.check_output, args=([sys.executable, "-c", code],), rounds=1, iterations=1)
    benchmark.extra_info["peak_bytes"] = int(peak)
    record(Figure("peak memory [MB]", int(peak) / 1e6, f"{WORLDS} worlds, the environment's process"))
