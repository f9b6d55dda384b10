"""What every simulation of the character does in the benchmarks: noisy actions, and new starts as in training."""

import multiprocessing as mp
import os
import time

import mujoco
import numpy as np
import torch

from murmillo.envs import EnvConfig, HumanoidVectorEnv

NOISE = 0.2
"""Half width of the uniform actions; the character falls within a second, as an untrained policy does."""
EPISODE = 25
"""Control steps after which a bare simulation begins anew: about what episodes last under such noise."""


def make_env(num_envs: int, **kwargs) -> HumanoidVectorEnv:
    """The environment as ASE trains on it, warmed up until its worlds' episodes are out of step with each other."""
    env = HumanoidVectorEnv(num_envs, EnvConfig(window=10, **kwargs))
    env.reset(seed=0)
    for step in range(20):
        env.step(noise(env.action_space.shape, step))
    return env


def noise(shape: tuple[int, ...], seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-NOISE, NOISE, shape).astype(np.float32)


def bare_steps_per_second(seconds: float = 3.0) -> float:
    """Control steps a second of mj_step alone (4 substeps), one process a CPU, from the environment's own starts."""
    env = HumanoidVectorEnv(64)
    starts = env._starts.draw(torch.zeros(256, dtype=torch.bool), torch.Generator().manual_seed(0))
    qpos, qvel = starts.qpos.numpy(), starts.qvel.numpy()
    targets = env.character.targets(torch.from_numpy(noise((256, 31), 0)).double()).numpy()
    arguments = (env.character.model, env.character.substeps, qpos, qvel, targets, seconds)
    with mp.get_context("spawn").Pool(os.cpu_count()) as pool:
        rates = [pool.apply_async(_loop, arguments) for _ in range(os.cpu_count() or 1)]
        return sum(rate.get() for rate in rates)


def _loop(model, substeps, qpos, qvel, targets, seconds: float) -> float:
    data = mujoco.MjData(model)
    begin, steps = time.perf_counter(), 0
    while (elapsed := time.perf_counter() - begin) < seconds:
        if steps % EPISODE == 0:
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:] = qpos[steps // EPISODE % 256], qvel[steps // EPISODE % 256]
        data.ctrl[:] = targets[steps % 256]
        mujoco.mj_step(model, data, substeps)
        steps += 1
    return steps / elapsed
