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

NOISE = 0.2
"""Half width of the uniform actions; the character falls within a second, as an untrained policy does."""
WARM_UP = 60
"""Steps until the worlds' episodes are out of step, and as many lie on the ground as in training."""


def make_env(num_envs: int, **kwargs: Any) -> HumanoidVectorEnv:
    """The environment as ASE trains on it, warmed up."""
    env = HumanoidVectorEnv(num_envs, EnvConfig(window=10, **kwargs))
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


def noise(shape: tuple[int, ...], seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-NOISE, NOISE, shape).astype(np.float32)


def bare_steps_per_second(num_envs: int = 1024, steps: int = 24) -> float:
    """Control steps a second of mj_step alone, one process a CPU, through the very states of the environment.

    Contacts decide what a step costs, so that the bare simulation is put where the environment's worlds are, step by
    step; reading, writing and all else that an environment does is left out.
    """
    env = make_env(num_envs)
    visited = []
    for step in range(steps):
        action = noise((num_envs, 31), WARM_UP + step)
        state = env.physics.state_dict()
        targets = env.character.targets(torch.from_numpy(action).double())
        visited.append([x.numpy() for x in (state["qpos"], state["qvel"], state["qacc_warmstart"], targets)])
        env.step(action)
    rows = [np.concatenate(field) for field in zip(*visited, strict=True)]
    cpus = os.cpu_count() or 1
    shares = [[field[cpu::cpus] for field in rows] for cpu in range(cpus)]
    with mp.get_context("spawn").Pool(cpus) as pool:
        model, substeps = env.character.model, env.character.substeps
        rates = [pool.apply_async(_bare_rate, (model, substeps, *share)) for share in shares]
        return sum(rate.get() for rate in rates)


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
