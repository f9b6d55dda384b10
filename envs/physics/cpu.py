"""MuJoCo's own pool of simulations on CPU threads."""

import warnings
from typing import Any

import mujoco
import numpy as np
import torch
from mujoco.batch import Batch
from torch import Tensor

from murmillo.envs.physics.interface import State
from murmillo.envs.rotations import quat_rotate
from murmillo.envs.scene import Scene

_INTEGRATED = ("time", "qpos", "qvel", "qacc_warmstart", "ctrl", "xfrc_applied")
"""What a step reads of the state before it; the scene has no activations, mocap bodies or user data."""
_NOTHING_MORE = int(mujoco.mjtStage.mjSTAGE_NONE)


class CpuPhysics:
    """`mujoco.batch.Batch` behind the `Physics` protocol. Results do not depend on the number of threads.

    The frames of the bodies after a step are reckoned here: MuJoCo would go through its collisions for them once more.
    """

    device = torch.device("cpu")

    def __init__(self, scene: Scene, num_envs: int, threads: int = 0) -> None:
        """`threads` = 0 takes every CPU."""
        character, props = scene.character, len(scene.props)
        self.num_envs = num_envs
        self._character = character
        self._substeps = character.substeps
        self._batch = Batch(scene.model, num_envs, threads)
        self._ctrl = self._batch.bind("ctrl")
        own = slice(1, 1 + len(character.bodies))
        self._xfrc = self._batch.bind("xfrc_applied")[:, own]
        self._com = torch.from_numpy(scene.model.body_ipos[own].copy())
        self._time = self._batch.bind("time")
        qpos, qvel = _view(self._batch.bind("qpos")), _view(self._batch.bind("qvel"))
        sensors = _view(self._batch.bind("sensordata"))
        nq, nv, bodies = character.model.nq, character.model.nv, len(character.bodies)
        self.state = State(
            qpos=qpos[:, :nq],
            qvel=qvel[:, :nv],
            # laid out as `forward_kinematics` gives them, component by component
            body_pos_w=torch.zeros(3, bodies, num_envs, dtype=torch.float64).permute(2, 1, 0),
            body_quat_w=torch.zeros(4, bodies, num_envs, dtype=torch.float64).permute(2, 1, 0),
            ground_force_w=sensors[:, character.contact_slice].unflatten(1, (bodies, 3)),
            actuator_force=_view(self._batch.bind("actuator_force")),
            key_bodies=torch.tensor(character.body_ids(character.key_bodies)),
            prop_qpos=qpos[:, nq:].unflatten(1, (props, 7)),
            prop_qvel=qvel[:, nv:].unflatten(1, (props, 6)),
            hit_force_w=torch.zeros(num_envs, props, bodies, 3, dtype=torch.float64),
        )
        self._hits = scene.hits(_view(self._batch.bind("history")))
        self._ground = np.flatnonzero(scene.model.geom_bodyid == 0)
        self._expected_time = np.zeros(num_envs)
        self._timestep = scene.model.opt.timestep
        self._batch.reset(stage=_NOTHING_MORE)
        self._find_bodies()

    def step(self, ctrl: Tensor, body_force_w: Tensor | None = None) -> None:
        self._ctrl[:] = ctrl.numpy()
        if body_force_w is None:
            self._xfrc[:] = 0.0
        else:
            to_com = quat_rotate(self.state.body_quat_w, self._com)
            self._xfrc[..., :3] = body_force_w.numpy()
            self._xfrc[..., 3:] = torch.linalg.cross(body_force_w.double(), to_com).numpy()
        self._expected_time = self._time.ravel() + 0.5 * self._substeps * self._timestep
        self._batch.step(nstep=self._substeps, stage=_NOTHING_MORE)
        self._find_bodies()
        if self._hits.numel():
            self._feel()

    def _find_bodies(self, worlds: Tensor | slice = slice(None)) -> None:
        pos_w, quat_w = self._character.forward_kinematics(self.state.qpos[worlds])
        self.state.body_pos_w[worlds], self.state.body_quat_w[worlds] = pos_w, quat_w

    def _feel(self) -> None:
        """The greatest force of all substeps, for a fast prop touches a body in one alone; few worlds have any."""
        felt = self.state.hit_force_w.zero_()
        struck = self._hits.flatten(3).abs().amax((1, 2, 3)).nonzero().squeeze(-1)
        samples = self._hits[struck]
        most, least = samples.amax(3), samples.amin(3)
        felt[struck] = torch.where(most >= -least, most, least)

    def healed(self) -> Tensor:
        # MuJoCo resets a diverged simulation to its defaults; its clock then starts again from zero
        return torch.from_numpy(self._time.ravel() < self._expected_time)

    def write(self, env_ids: Tensor, qpos: Tensor, qvel: Tensor) -> None:
        ids = env_ids.numpy()
        self._batch.reset(ids, stage=_NOTHING_MORE)
        self.state.qpos[env_ids] = qpos.double()
        self.state.qvel[env_ids] = qvel.double()
        self.state.hit_force_w[env_ids] = 0.0
        self._find_bodies(env_ids)

    def set_friction(self, env_ids: Tensor, friction: Tensor) -> None:
        of_geoms = self._batch.expand("geom_friction")
        for geom in self._ground:
            of_geoms[env_ids.numpy(), geom, 0] = friction.numpy()

    def close(self) -> None:
        pass

    def state_dict(self) -> dict[str, Any]:
        state = {name: torch.from_numpy(self._batch.bind(name).copy()) for name in _INTEGRATED}
        friction = self._batch.expanded("geom_friction")
        return state if friction is None else state | {"friction": torch.from_numpy(friction.copy())}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self._batch.reset(stage=_NOTHING_MORE)  # MuJoCo files what sensors feel by its clock
        for name in _INTEGRATED:
            self._batch.bind(name)[:] = state[name].numpy()
        if "friction" in state:
            self._batch.expand("geom_friction")[:] = state["friction"].numpy()
        self._find_bodies()


def _view(array: np.ndarray) -> Tensor:
    """A tensor over the batch's memory; derived fields are read-only, which torch can only warn about."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The given NumPy array is not writable")
        return torch.from_numpy(array)
