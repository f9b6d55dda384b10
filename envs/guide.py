"""What leads a character along the clips that it follows: targets of its joints, and forces where it may be helped."""

import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.forces import OutsideForces
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_rotate_inverse
from murmillo.envs.tracking import Tracker

_STIFFNESS = 1000.0
"""[N/m] of what pulls a body to where the clip has it; 5 cm are the whole of 50 N."""
_DAMPING = 100.0
"""[N s/m]"""


class Guide:
    """An expert to learn from, which knows the clip and its clock as no policy does.

    The joints' targets alone go the clip's way and keep no balance. With residual forces (C·ASE section 3.1) every body
    is also pulled to where the clip has it, as a spring and a damper would: with up to 50 N an axis and body that
    leads 240 starts of the ten built-in clips of `docs/learning.md` through 10 s without a fall.
    """

    def __init__(self, character: Character, tracker: Tracker, forces: OutsideForces) -> None:
        self._character, self._tracker, self._forces = character, tracker, forces

    def action(self, state: State, ground: Tensor | None = None) -> Tensor:
        """[N, A] float32, in whatever states the worlds are, over a ground [N] [m]; None is level at 0.

        The targets are the clips' poses as much later as the PD control lags behind (`Character.lag`).
        """
        character = self._character
        targets = character.action_for(character.from_base(*self._tracker.wanted(character.lag))[0])
        if not self._forces.residual_dim:
            return targets
        qpos, qvel = character.from_base(*self._tracker.wanted(CONTROL_DT))
        wanted, speed = self._seen(*character.forward_kinematics(qpos), qpos, qvel)
        here = (state.body_pos_w, state.body_quat_w, state.qpos, state.qvel)
        position, velocity = self._seen(*(part.float() for part in here))
        if ground is not None:
            position[..., 2] -= ground.float().unsqueeze(-1)
        force_h = _STIFFNESS * (wanted - position) + _DAMPING * (speed - velocity)
        return torch.cat((targets, self._forces.residual_action(force_h)), -1)

    def _seen(self, pos_w: Tensor, quat_w: Tensor, qpos: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Positions and velocities of bodies [N, B, 3] [m], [m/s], heading frame about the point under the root."""
        heading = heading_quat(qpos[:, None, 3:7])
        under = qpos[:, None, :3] * qpos.new_tensor([1.0, 1.0, 0.0])
        velocity_w, _ = self._character.velocities(pos_w, quat_w, qvel)
        return quat_rotate_inverse(heading, pos_w - under), quat_rotate_inverse(heading, velocity_w)
