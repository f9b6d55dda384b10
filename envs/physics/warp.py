"""MuJoCo Warp: all worlds on one device, a GPU or Warp's own CPU device, whose state torch sees without a copy."""

import contextlib
import copy
import math
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import torch
import warp as wp
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import kernels
from murmillo.envs.physics.interface import State
from murmillo.envs.scene import Scene

_CHECK_EVERY = 32
"""Control steps from one look at a GPU's overflow flags to the next: looking waits for all that was launched."""
_KEPT = 16
"""How many of the last states that diverged are kept."""
_MARGIN = 2.0
"""Room for this many times the contacts and constraints of the warm-up."""
_TRIED_WORLDS, _TRIED_STEPS, _TRIED_ROOM = 8, 45, 128
"""Of the warm-up: worlds, control steps, contacts in a world."""
_LONG = 10.0
"""[s] A first step that takes longer has compiled kernels."""

_OVERFLOWS = {
    "contacts": mjw.OverflowType.BROADPHASE | mjw.OverflowType.NARROWPHASE | mjw.OverflowType.CCD,
    "constraints": mjw.OverflowType.NEFC | mjw.OverflowType.NJMAX_NNZ,
    "terrain.spacing": mjw.OverflowType.HFIELD,
}
"""The setting that each of these asks to be raised; to reach the MJCF's limit of solver iterations is no overflow."""

_INTEGRATED = ("time", "qpos", "qvel", "qacc_warmstart", "ctrl", "xfrc_applied")
"""What a step reads of the state before it."""


class WarpPhysics:
    """`mujoco_warp` behind the `Physics` protocol, in float32.

    On a GPU a control step is one captured graph, and sums of forces depend on the order in which threads come: results
    are equal up to rounding, not bit for bit. On Warp's CPU device they are.

    Attributes:
        contacts, constraints: how many a world has room for, of contacts on average over the worlds.
    """

    def __init__(
        self, scene: Scene, num_envs: int, device: str = "auto", contacts: int = 0, constraints: int = 0
    ) -> None:
        """A capacity of 0 is measured on worlds in which the character falls, with a margin.

        Raises:
            SuiteError: no such device, or a scene that MuJoCo Warp does not simulate.
        """
        self.num_envs = num_envs
        self._warp_device = _find_device(device)
        self.device = torch.device(wp.device_to_torch(self._warp_device))
        self._substeps = scene.character.substeps
        self._graph: wp.Graph | None = None
        self._loaded = False  # the first step loads kernels, which a capture must not
        self._unchecked = 0
        with self._launching():
            model = _simulated(scene.model)
            _compile(model, self._warp_device)
            if not (contacts and constraints):
                measured = _measure(model, self._substeps)
                contacts, constraints = contacts or measured[0], constraints or measured[1]
            self.contacts, self.constraints = contacts, constraints
            self._model = _put(model)
            self._data = mjw.make_data(model, num_envs, nconmax=contacts, njmax=constraints)
            self._allocate(scene, model)
        self.state = self._views(scene)
        self._refresh()

    def step(self, ctrl: Tensor, body_force_w: Tensor | None = None) -> None:
        self._ctrl.copy_(ctrl)
        self._xfrc.zero_()
        if body_force_w is not None:
            arm = self.state.body_pos_w - self._com_w
            force = body_force_w.to(arm)
            self._xfrc[..., :3] = force
            self._xfrc[..., 3:] = torch.linalg.cross(arm, force)
        if self._loaded and self._warp_device.is_cuda:
            self._launch_graph()
        else:
            with self._launching():
                self._control_step()
            self._loaded = True
        self._unchecked += 1
        if self._unchecked >= _CHECK_EVERY or not self._warp_device.is_cuda:
            self.check()

    def healed(self) -> Tensor:
        return self._healed.clone()

    @property
    def diverged(self) -> dict[str, Tensor]:
        """The last worlds that diverged, as they were before that step: `qpos` [k, nq], `qvel` [k, nv], `ctrl` [k, A].

        k is at most 16; `count` is the number of all of them. Reading it waits for the device.
        """
        kept = min(int(self._count), _KEPT)
        return {"count": self._count.clone(), **{name: rows[:kept].clone() for name, rows in self._kept.items()}}

    def check(self) -> None:
        """Look whether contacts or constraints went beyond their room since the last look; waits for the device.

        Raises:
            SuiteError: they did, so that some of them were left out: the setting to raise.
        """
        self._unchecked = 0
        bits = int(torch.stack([(self._overflow & bit).any() * bit for bit in _BITS]).sum())
        for setting, of_setting in _OVERFLOWS.items():
            if bits & of_setting:
                room = getattr(self, setting, None)
                cure = f"{setting}={room}: is too little room in a world; raise it" if room else f"{setting}: raise it"
                raise SuiteError(f"physics=warp: {cure}, for contacts were lost")

    def close(self) -> None:
        """Check the steps since the last look."""
        self.check()

    def write(self, env_ids: Tensor, qpos: Tensor, qvel: Tensor) -> None:
        data, nq, nv = self._torch, self.state.qpos.shape[1], self.state.qvel.shape[1]
        for name in ("qvel", "qacc", "qacc_warmstart", "ctrl", "xfrc_applied", "actuator_force", "time"):
            data[name][env_ids] = 0.0
        self.state.ground_force_w[env_ids] = 0.0
        self.state.hit_force_w[env_ids] = 0.0
        data["qpos"][env_ids] = self._qpos0
        data["qpos"][env_ids, :nq] = qpos.float()
        data["qvel"][env_ids, :nv] = qvel.float()
        self._refresh()

    def set_friction(self, env_ids: Tensor, friction: Tensor) -> None:
        of_geoms = self._per_world("geom_friction")
        for geom in self._ground:
            of_geoms[env_ids, geom, 0] = friction.float()

    def state_dict(self) -> dict[str, Any]:
        """Raises SuiteError where contacts were lost since the last look: such a state is not to be kept."""
        self.check()
        state = {name: self._torch[name].clone() for name in _INTEGRATED}
        if "geom_friction" in self._fields:
            state["friction"] = self._fields["geom_friction"].clone()
        return state

    def load_state_dict(self, state: dict[str, Any]) -> None:
        for name in _INTEGRATED:
            self._torch[name].copy_(state[name])
        if "friction" in state:
            self._per_world("geom_friction").copy_(state["friction"])
        self._refresh()

    # --- on the device ------------------------------------------------------------------------------------------------

    def _control_step(self) -> None:
        """All that a graph holds: substeps, what is felt in them, and worlds that diverged."""
        model, data = self._model, self._data
        wp.copy(self._qpos_before, data.qpos)
        wp.copy(self._qvel_before, data.qvel)
        self._hit_force.zero_()
        for substep in range(self._substeps):
            mjw.step(model, data)
            if self._hit_force.size or substep == self._substeps - 1:
                self._feel()
        wp.launch(
            kernels.heal,
            dim=self.num_envs,
            inputs=[model.qpos0, self._qpos_before, self._qvel_before],
            outputs=[
                *(data.qpos, data.qvel, data.ctrl, data.qacc, data.qacc_warmstart, data.actuator_force, data.time),
                *(self._ground_force, self._hit_force, self._healed_in, self._count_in, *self._kept_in),
            ],
        )
        mjw.kinematics(model, data)

    def _feel(self) -> None:
        data = self._data
        mjw.contact_force(self._model, data, self._contact_ids, True, self._contact_force)  # type: ignore[arg-type]
        self._ground_force.zero_()
        wp.launch(
            kernels.feel,
            dim=data.naconmax,
            inputs=[
                *(data.nacon, self._contact_force, data.contact.geom, data.contact.worldid, self._model.geom_bodyid),
                *(self._ground_force.shape[1], self._feels_everything),
            ],
            outputs=[self._ground_force, self._hit_sample],
        )
        if self._hit_force.size:
            wp.launch(
                kernels.keep_greatest, dim=self._hit_force.shape, inputs=[self._hit_sample], outputs=[self._hit_force]
            )

    def _refresh(self) -> None:
        """Derived fields of the positions as they are."""
        with self._launching():
            mjw.kinematics(self._model, self._data)

    def _launch_graph(self) -> None:
        stream = wp.stream_from_torch(torch.cuda.current_stream(self.device))
        if self._graph is None:
            torch.cuda.synchronize(self.device)
            with wp.ScopedDevice(self._warp_device), wp.ScopedCapture() as capture:
                self._control_step()
            self._graph = capture.graph
        assert self._graph is not None
        wp.capture_launch(self._graph, stream)

    @contextlib.contextmanager
    def _launching(self) -> Iterator[None]:
        """Launch on the device, and on a GPU in the stream that torch works in."""
        if self._warp_device.is_cuda:
            with wp.ScopedStream(wp.stream_from_torch(torch.cuda.current_stream(self.device))):
                yield
        else:
            with wp.ScopedDevice(self._warp_device):
                yield

    # --- memory -------------------------------------------------------------------------------------------------------

    def _allocate(self, scene: Scene, model: mujoco.MjModel) -> None:
        """What the kernels of a control step work with."""
        n, bodies, props = self.num_envs, len(scene.character.bodies), len(scene.props)
        data = self._data
        self._qpos_before, self._qvel_before = wp.empty_like(data.qpos), wp.empty_like(data.qvel)
        self._contact_ids = wp.from_torch(torch.arange(data.naconmax, dtype=torch.int32, device=self.device))
        self._contact_force = wp.zeros(data.naconmax, dtype=wp.spatial_vector)
        self._ground_force = wp.zeros((n, bodies), dtype=wp.vec3)
        self._hit_force = wp.zeros((n, props, bodies), dtype=wp.vec3)
        self._hit_sample = wp.zeros_like(self._hit_force)
        self._healed_in, self._count_in = wp.zeros(n, dtype=bool), wp.zeros(1, dtype=int)
        self._kept_in = [wp.zeros((_KEPT, width), dtype=float) for width in (model.nq, model.nv, model.nu)]
        self._healed, self._count = wp.to_torch(self._healed_in), wp.to_torch(self._count_in)
        self._kept = dict(zip(("qpos", "qvel", "ctrl"), map(wp.to_torch, self._kept_in), strict=True))
        self._feels_everything = scene.feels_everything
        self._ground = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 0]
        self._qpos0 = torch.as_tensor(model.qpos0, dtype=torch.float32, device=self.device)
        self._fields: dict[str, Tensor] = {}

    def _views(self, scene: Scene) -> State:
        """The data as torch sees them."""
        character, props, data = scene.character, len(scene.props), self._data
        names = (*_INTEGRATED, "qacc", "actuator_force", "overflow", "xpos", "xquat", "xipos")
        self._torch = {name: wp.to_torch(getattr(data, name)) for name in names}
        self._ctrl, self._overflow = self._torch["ctrl"], self._torch["overflow"]
        own = slice(1, 1 + len(character.bodies))
        self._xfrc, self._com_w = self._torch["xfrc_applied"][:, own], self._torch["xipos"][:, own]
        nq, nv = character.model.nq, character.model.nv
        qpos, qvel = self._torch["qpos"], self._torch["qvel"]
        return State(
            qpos=qpos[:, :nq],
            qvel=qvel[:, :nv],
            body_pos_w=self._torch["xpos"][:, own],
            body_quat_w=self._torch["xquat"][:, own],
            ground_force_w=wp.to_torch(self._ground_force),
            actuator_force=self._torch["actuator_force"],
            key_bodies=torch.tensor(character.body_ids(character.key_bodies), device=self.device),
            prop_qpos=qpos[:, nq:].unflatten(1, (props, 7)),
            prop_qvel=qvel[:, nv:].unflatten(1, (props, 6)),
            hit_force_w=wp.to_torch(self._hit_force),
        )

    def _per_world(self, name: str) -> Tensor:
        """A field of the model [N, ...] with a row a world, which may be written to; until now all shared one."""
        if name not in self._fields:
            shared = wp.to_torch(getattr(self._model, name))
            with self._launching():
                own = wp.from_torch(
                    shared.expand(self.num_envs, *shared.shape[1:]).contiguous(), dtype=getattr(self._model, name).dtype
                )
            setattr(self._model, name, own)
            self._fields[name] = wp.to_torch(own)
            self._graph = None  # it was captured with the shared field
        return self._fields[name]


_BITS = [1 << i for i in range(16) if any((1 << i) & bits for bits in _OVERFLOWS.values())]


def _find_device(name: str) -> wp.Device:
    """Warp's device of this name; "auto" is the first GPU."""
    wp.config.log_level = max(wp.config.log_level, wp.LOG_ERROR)  # no banner; what matters is said here
    if name == "auto":
        if not wp.is_cuda_available():
            raise SuiteError(
                "physics=warp: Warp finds no GPU, though torch does; update the driver, or take physics=cpu"
            )
        name = "cuda:0"
    try:
        device = wp.get_device(name)
        torch.empty(0, device=name)
    except (ValueError, RuntimeError, AssertionError) as error:
        known = ", ".join(str(each) for each in wp.get_devices())
        raise SuiteError(f"device={name}: no such device; there are: {known}") from error
    return device


def _simulated(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model without sensors: forces are summed up by kernels of our own, which cost less."""
    model = copy.copy(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    return model


def _put(model: mujoco.MjModel) -> mjw.Model:
    try:
        put = mjw.put_model(model)
    except (NotImplementedError, ValueError) as error:
        raise SuiteError(f"physics=warp: MuJoCo Warp cannot simulate this scene ({error}); take physics=cpu") from error
    put.opt.warn_overflow = 0  # `check` says it, once
    return put


def _compile(model: mujoco.MjModel, device: wp.Device) -> None:
    """Step one world, which compiles what is not in Warp's cache yet, and say so where that takes long."""
    begun = time.monotonic()
    late = threading.Timer(
        _LONG, _say, [f"compiling kernels for {device.alias}; the first time takes minutes, later ones seconds"]
    )
    late.start()
    try:
        mjw.step(_put(model), mjw.make_data(model, 1))
        wp.synchronize_device(device)
    finally:
        late.cancel()
    if (seconds := time.monotonic() - begun) > _LONG:
        _say(f"compiled in {seconds:.0f} s; kept in {wp.config.kernel_cache_dir}")


def _say(what: str) -> None:
    print(f"physics=warp: {what}", file=sys.stderr, flush=True)


def _measure(model: mujoco.MjModel, substeps: int) -> tuple[int, int]:
    """Room for contacts and for constraints in a world, from characters that fall with limbs flailing, under props."""
    put, data = _put(model), mjw.make_data(model, _TRIED_WORLDS, nconmax=_TRIED_ROOM, njmax=4 * _TRIED_ROOM)
    random = np.random.default_rng(0)
    top = float(model.geom_pos[0, 2] + model.hfield_size[0, 2]) if model.nhfield else 0.0
    qpos = np.tile(model.qpos0, (_TRIED_WORLDS, 1))
    for above, joint in enumerate(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)):
        place = slice(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + 7)
        qpos[:, place] = random.normal(size=(_TRIED_WORLDS, 7))
        qpos[:, place][:, :3] = [0.1 * above, 0.0, top + 1.0 + above]
    data.qpos.assign(qpos)
    low, high = model.actuator_ctrlrange.T
    contacts = constraints = candidates = 0
    for _ in range(_TRIED_STEPS):
        data.ctrl.assign(random.uniform(low, high, (_TRIED_WORLDS, model.nu)))
        for _ in range(substeps):
            mjw.step(put, data)
            constraints = max(constraints, int(data.nefc.numpy().max()))
            candidates = max(candidates, int(data.ncollision.numpy()[0]))
            of_worlds = np.bincount(data.contact.worldid.numpy()[: int(data.nacon.numpy()[0])], minlength=1)
            contacts = max(contacts, int(of_worlds.max()))
    contacts = max(contacts, math.ceil(candidates / _TRIED_WORLDS))
    return _rounded(_MARGIN * contacts), _rounded(_MARGIN * constraints)


def _rounded(room: float) -> int:
    return 16 * math.ceil(room / 16)
