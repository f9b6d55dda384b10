"""What only a GPU can tell: MuJoCo Warp's speed, and where the time of an iteration goes."""

import time
from pathlib import Path

import pytest
import torch

from murmillo.agents.ase.agent import ASE
from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.common.runner import Runner, RunnerConfig
from murmillo.envs import EnvConfig, HumanoidVectorEnv

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(not torch.cuda.is_available(), reason="needs an NVIDIA GPU that torch can use"),
]

GPU = torch.device("cuda:0")


def on_gpu(worlds: int, window: int = 1) -> HumanoidVectorEnv:
    return HumanoidVectorEnv(worlds, EnvConfig(physics="warp", device="cuda:0", tensors=True, window=window))


def test_physics_at_8192_worlds(benchmark) -> None:
    env, steps = on_gpu(8192), 50
    env.reset(seed=0)
    with GPU:
        targets = env.character.targets(torch.zeros(8192, 31))

    def stepped() -> None:
        for _ in range(steps):
            env.physics.step(targets)
        torch.cuda.synchronize()

    stepped()
    benchmark.pedantic(stepped, rounds=5)
    benchmark.extra_info["control steps/s"] = round(8192 * steps / benchmark.stats["min"])
    print(f"physics: {8192 * steps / benchmark.stats['min']:,.0f} control steps/s (aim 600,000)")


def test_an_iteration_of_ase_with_the_papers_networks(benchmark, tmp_path: Path) -> None:
    config = ASEConfig()
    env = on_gpu(4096, config.window)
    with GPU:
        generator = torch.Generator(GPU).manual_seed(0)
        agent = ASE(env, env.demonstrations, config, generator)
        runner = Runner(env, agent, RunnerConfig(), generator, tmp_path)
        shares = benchmark.pedantic(_shares, args=(runner,), rounds=1)
    total = sum(shares.values())
    print(", ".join(f"{name} {seconds / total:.0%}" for name, seconds in shares.items()))
    print(f"ASE: {runner._rollout.samples / total:,.0f} samples/s (aim 150,000)")


def _shares(runner: Runner) -> dict[str, float]:
    """Seconds of the parts of the third iteration."""
    seconds: dict[str, float] = {}
    for _ in range(3):
        for name, part in (
            ("collect", lambda: runner._collect()),
            ("reward", lambda: runner._reward(runner._rollout)),
            ("advantage", lambda: runner._advantage(runner._rollout)),
            ("update", lambda: runner.agent.update(runner._rollout)),
        ):
            torch.cuda.synchronize()
            begun = time.perf_counter()
            part()
            torch.cuda.synchronize()
            seconds[name] = time.perf_counter() - begun
    return seconds
