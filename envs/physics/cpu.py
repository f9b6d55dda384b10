"""MuJoCo's own pool of simulations on CPU threads."""

import warnings
from typing import Any

import mujoco
import numpy as np
import torch
from mujoco.batch import Batch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.physics.interface import State

_INTEGRATED = ("time", "qpos", "qvel", "qacc_warmstart", "ctrl", "xfrc_applied")
"""What a step reads of the state before it; the character has no activations, mocap bodies or user data."""


class CpuPhysics:
    """`mujoco.batch.Batch` behind the `Physics` protocol. Results do not depend on the number of threads."""

    def __init__(self, character: Character, num_envs: int, threads: int = 0) -> None:
        """`threads` = 0 takes every CPU."""
        self.num_envs = num_envs
        self._substeps = character.substeps
        self._batch = Batch(character.model, num_envs, threads)
        self._ctrl = self._batch.bind("ctrl")
        self._xfrc = self._batch.bind("xfrc_applied")
        self._time = self._batch.bind("time")
        ground = self._batch.bind("sensordata")[:, character.contact_slice]
        self.state = State(
            qpos=_view(self._batch.bind("qpos")),
            qvel=_view(self._batch.bind("qvel")),
            body_pos_w=_view(self._batch.bind("xpos"))[:, 1:],
            body_quat_w=_view(self._batch.bind("xquat"))[:, 1:],
            body_com_w=_view(self._batch.bind("xipos"))[:, 1:],
            site_pos_w=_view(self._batch.bind("site_xpos")),
            ground_force_w=_view(ground).unflatten(1, (len(character.bodies), 3)),
            actuator_force=_view(self._batch.bind("actuator_force")),
            key_sites=torch.as_tensor(character.key_sites),
        )
        self._expected_time = np.zeros(num_envs)
        self._timestep = character.model.opt.timestep
        self._batch.reset(stage=int(mujoco.mjtStage.mjSTAGE_VEL))

    def step(self, ctrl: Tensor, body_force_w: Tensor | None = None) -> None:
        self._ctrl[:] = ctrl.numpy()
        if body_force_w is None:
            self._xfrc[:] = 0.0
        else:
            arm = self.state.body_pos_w - self.state.body_com_w
            self._xfrc[:, 1:, :3] = body_force_w.numpy()
            self._xfrc[:, 1:, 3:] = torch.linalg.cross(arm, body_force_w.double()).numpy()
        self._expected_time = self._time.ravel() + 0.5 * self._substeps * self._timestep
        self._batch.step(nstep=self._substeps, stage=int(mujoco.mjtStage.mjSTAGE_VEL))

    def healed(self) -> Tensor:
        # MuJoCo resets a diverged simulation to its defaults; its clock then starts again from zero
        return torch.from_numpy(self._time.ravel() < self._expected_time)

    def write(self, env_ids: Tensor, qpos: Tensor, qvel: Tensor) -> None:
        ids = env_ids.numpy()
        self._batch.reset(ids, stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        self.state.qpos[env_ids] = qpos.double()
        self.state.qvel[env_ids] = qvel.double()
        self._batch.forward(ids, stage=int(mujoco.mjtStage.mjSTAGE_VEL))

    def state_dict(self) -> dict[str, Any]:
        return {name: torch.from_numpy(self._batch.bind(name).copy()) for name in _INTEGRATED}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        for name in _INTEGRATED:
            self._batch.bind(name)[:] = state[name].numpy()
        self._batch.forward(stage=int(mujoco.mjtStage.mjSTAGE_VEL))


def _view(array: np.ndarray) -> Tensor:
    """A tensor over the batch's memory; derived fields are read-only, which torch can only warn about."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The given NumPy array is not writable")
        return torch.from_numpy(array)
