"""What the suite asks of a physics engine: N worlds of one character, stepped together."""

from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor


@dataclass(frozen=True)
class State:
    """Live views of N worlds, current after every `step` and `write`: float64 of MuJoCo, float32 of MuJoCo Warp.

    Read them and never write to them, but for the props' own state, which is their task's to set.

    Frames: `_w` world. B bodies of the character in MJCF order, P props.

    Attributes:
        qpos: [N, nq] root position [m] and quaternion (wxyz), then the joints in MJCF order.
        qvel: [N, nv] root linear velocity (world) [m/s], root angular velocity (root frame) and joints [rad/s].
        body_pos_w: [N, B, 3] body origins [m].
        body_quat_w: [N, B, 4] body rotations.
        ground_force_w: [N, B, 3] force of the ground on each body in the last substep [N].
        actuator_force: [N, A] torque of the PD control at each axis of the joints in the last substep [N m].
        key_bodies: [K] the bodies whose origins are the key points.
        prop_qpos: [N, P, 7] the props' positions [m] and quaternions (wxyz) in the world.
        prop_qvel: [N, P, 6] their linear velocities (world) [m/s] and angular ones (own frame) [rad/s].
        hit_force_w: [N, P, B, 3] force of each prop on each body, each axis' greatest of the last step's substeps [N].
    """

    qpos: Tensor
    qvel: Tensor
    body_pos_w: Tensor
    body_quat_w: Tensor
    ground_force_w: Tensor
    actuator_force: Tensor
    key_bodies: Tensor
    prop_qpos: Tensor
    prop_qvel: Tensor
    hit_force_w: Tensor

    @property
    def key_pos_w(self) -> Tensor:
        """[N, K, 3] key points [m], a copy."""
        return self.body_pos_w[:, self.key_bodies]


class Physics(Protocol):
    """N worlds of one character."""

    state: State
    num_envs: int
    device: torch.device
    """Where the state is."""

    def step(self, ctrl: Tensor, body_force_w: Tensor | None = None) -> None:
        """Advance every world by one control step.

        Args:
            ctrl: [N, A] PD targets [rad].
            body_force_w: [N, B, 3] forces at the body origins [N], held over the substeps; None applies none.
        """
        ...

    def write(self, env_ids: Tensor, qpos: Tensor, qvel: Tensor) -> None:
        """Put the worlds env_ids [n] into qpos [n, nq] and qvel [n, nv], and forget all that the solver kept.

        Props go back to where the scene has them.
        """
        ...

    def set_friction(self, env_ids: Tensor, friction: Tensor) -> None:
        """Give the ground of the worlds env_ids [n] a coefficient of sliding friction [n] from now on.

        It is that of every contact with the ground if the scene was laid out so (`slippery`), else at least that.
        """
        ...

    def healed(self) -> Tensor:
        """[N] bool: worlds that the engine reset during the last step because their state had diverged."""
        ...

    def close(self) -> None:
        """Let go of it. Raises SuiteError for what has gone wrong and was not yet said."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Everything that the next step depends on, as tensors."""
        ...

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`, bit for bit."""
        ...
