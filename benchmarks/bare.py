"""MuJoCo without an environment, through the states that ours visits: the upper bounds of its speed.

Contacts decide what a step costs, so that the bare simulations are put where the environment's worlds are, step by
step; reading, writing and all else that an environment does is left out.
"""

import multiprocessing as mp
import time
from typing import Any

import mujoco
import numpy as np
import torch
from mujoco.rollout import Rollout

from murmillo.cli.benching.stepping import Stepping
from murmillo.cli.benching.turns import Rates
from murmillo.cli.versions import usable_cores
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.character import Character

BARE = "bare mj_step"
ROLLOUT = "mujoco.rollout"

Visit = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""(qpos, qvel, qacc_warmstart, ctrl) of all worlds before a step, each [N, .]."""


class Visiting(Stepping):
    """Steps of an environment, and of the bare simulations through the states of its last turn."""

    def __init__(self, env: HumanoidVectorEnv, steps: int) -> None:
        super().__init__(env, steps)
        self._visited: list[Visit] = []
        self._processes = _Processes(env.character)
        self._threads = _Threads(env.character, env.num_envs)

    def turn(self) -> Rates:
        self._visited.clear()
        ours = super().turn()
        return {
            BARE: self._processes.rate(self._visited),
            ROLLOUT: self._threads.rate(self._visited),
            **ours,
        }

    def before_step(self, action: np.ndarray) -> None:
        state = self.env.physics.state_dict()
        targets = self.env.character.targets(torch.from_numpy(action).double())
        qpos, qvel, warmstart = (state[name].numpy() for name in ("qpos", "qvel", "qacc_warmstart"))
        self._visited.append((qpos, qvel, warmstart, targets.numpy()))

    def close(self) -> None:
        self._processes.close()
        self._threads.close()
        super().close()


class _Processes:
    """mj_step alone, one process a core."""

    def __init__(self, character: Character) -> None:
        self._cores = usable_cores()
        self._model, self._substeps = character.model, character.substeps
        self._pool = mp.get_context("spawn").Pool(self._cores)

    def rate(self, visited: list[Visit]) -> float:
        """Control steps a second on all cores together."""
        rows = [np.concatenate(field) for field in zip(*visited, strict=True)]
        shares = [[field[core :: self._cores] for field in rows] for core in range(self._cores)]
        rates = [self._pool.apply_async(_bare_rate, (self._model, self._substeps, *share)) for share in shares]
        return sum(rate.get() for rate in rates)

    def close(self) -> None:
        self._pool.terminate()
        self._pool.join()


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


class _Threads:
    """`mujoco.rollout`, the library's own pool of threads: a control step of all worlds a call."""

    def __init__(self, character: Character, num_envs: int) -> None:
        self._model, self._substeps = character.model, character.substeps
        self._data = [mujoco.MjData(character.model) for _ in range(usable_cores())]
        self._rollout = Rollout(nthread=len(self._data))
        size = mujoco.mj_stateSize(character.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._state = np.empty((num_envs, self._substeps, size))
        self._sensors = np.empty((num_envs, self._substeps, character.model.nsensordata))

    def rate(self, visited: list[Visit]) -> float:
        """Control steps a second on all cores together."""
        seconds = 0.0
        for qpos, qvel, warmstart, targets in visited:
            initial = np.hstack([np.zeros((len(qpos), 1)), qpos, qvel])  # MuJoCo's full state begins with the time
            begin = time.perf_counter()
            self._rollout.rollout(
                self._model,
                self._data,
                initial,
                np.repeat(targets[:, None], self._substeps, 1),
                initial_warmstart=warmstart,
                state=self._state,
                sensordata=self._sensors,
            )
            seconds += time.perf_counter() - begin
        return sum(len(visit[0]) for visit in visited) / seconds

    def close(self) -> None:
        self._rollout.close()
