"""What every simulation of the character does in the benchmarks: noisy actions, and new starts as in training."""

import multiprocessing as mp
import os
import time
from typing import Any

import mujoco
import numpy as np
import torch

from murmillo.agents.common.runner import Runner
from murmillo.cli.agents import make_agent
from murmillo.cli.config import compose_train
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.character import Character
from murmillo.envs.tasks import Task

NOISE = 0.2
"""Half width of the uniform actions; the character falls within a second, as an untrained policy does."""
WARM_UP = 60
"""Steps until the worlds' episodes are out of step, and as many lie on the ground as in training."""


def make_env(num_envs: int, task: Task | None = None) -> HumanoidVectorEnv:
    """The environment as ASE trains on it, or with a task, warmed up."""
    env = HumanoidVectorEnv(num_envs, EnvConfig(window=10), task)
    env.reset(seed=0)
    for step in range(WARM_UP):
        env.step(noise((num_envs, 31), step))
    return env


def make_runner(budget: str, *settings: str, num_envs: int | None = None) -> Runner:
    """A training run of this budget on the built-in clips, without its folder, log and warm start."""
    words = [f"budget={budget}", *settings] + ([f"num_envs={num_envs}"] if num_envs else [])
    config = compose_train(words)
    torch.set_num_threads(os.cpu_count() or 1)
    env = HumanoidVectorEnv(config.num_envs, config.env)
    agent, generator = make_agent(config.choices["agent"], config.agent, env, config.seed)
    return Runner(env, agent, config.runner, generator, "benchmarks/results/checkpoint")


def iterate(runner: Runner) -> None:
    """One iteration of training, without log and checkpoint."""
    runner._direct()
    rollout = runner._collect()
    runner._reward(rollout)
    runner._advantage(rollout)
    runner.agent.update(rollout)


def noise(shape: tuple[int, ...], seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-NOISE, NOISE, shape).astype(np.float32)


class BareSimulation:
    """mj_step alone, one process a CPU, through states that the environment visited.

    Contacts decide what a step costs, so that the bare simulation is put where the environment's worlds are, step by
    step; reading, writing and all else that an environment does is left out.
    """

    def __init__(self, character: Character) -> None:
        self._cpus = os.cpu_count() or 1
        self._model, self._substeps = character.model, character.substeps
        self._pool = mp.get_context("spawn").Pool(self._cpus)

    def rate(self, visited: list[list[np.ndarray]]) -> float:
        """Control steps a second on all CPUs through these steps' (qpos, qvel, qacc_warmstart, ctrl), each [N, .]."""
        rows = [np.concatenate(field) for field in zip(*visited, strict=True)]
        shares = [[field[cpu :: self._cpus] for field in rows] for cpu in range(self._cpus)]
        rates = [self._pool.apply_async(_bare_rate, (self._model, self._substeps, *share)) for share in shares]
        return sum(rate.get() for rate in rates)

    def close(self) -> None:
        self._pool.terminate()


def _bare_rate(
    model: Any, substeps: int, qpos: np.ndarray, qvel: np.ndarray, warmstart: np.ndarray, targets: np.ndarray
) -> float:
    data = mujoco.MjData(model)
    begin = time.perf_counter()
    for row in range(len(qpos)):
        data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = qpos[row], qvel[row], warmstart[row]
        data.ctrl[:] = targets[row]
        mujoco.mj_step(model, data, substeps)
    return len(qpos) / (time.perf_counter() - begin)
