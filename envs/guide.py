"""What leads a character along the clips that it follows: targets of its joints, and forces where it may be helped."""

import torch
from torch import Tensor

from murmillo.envs.balance import Balance
from murmillo.envs.character import CONTROL_DT, Character
from murmillo.envs.forces import OutsideForces
from murmillo.envs.physics import State
from murmillo.envs.rotations import heading_quat, quat_rotate_inverse
from murmillo.envs.tracking import Tracker

_STIFFNESS = 10.0
"""[1/m] Share of the greatest force that pulls a body to where the clip has it; 10 cm are the whole of it."""
_DAMPING = 1.0
"""[s/m]"""


class Guide:
    """An expert to learn from, which knows the clip and its clock as no policy does.

    The joints' targets go the clip's way, and those of the legs that stand keep balance besides (`Balance`). With
    residual forces (C·ASE section 3.1) every body is also pulled to where the clip has it, by a spring and a damper.
    """

    def __init__(self, character: Character, tracker: Tracker, forces: OutsideForces) -> None:
        self._character, self._tracker, self._forces = character, tracker, forces
        self._balance = Balance(character)

    def action(self, state: State, ground: Tensor | None = None) -> Tensor:
        """[N, A] float32, in whatever states the worlds are, over a ground [N] [m]; None is level at 0.

        The targets are the clips' poses as much later as the PD control lags behind (`Character.lag`), and later by
        what a clip has waited: who led to where a clip waits would hold the character there.
        """
        character = self._character
        later = character.joint_coordinates(
            character.from_base(*self._tracker.wanted(character.lag + self._tracker.waited))[0]
        )
        targets = self._balance(later, state, *character.from_base(*self._tracker.wanted(0.0)), ground)
        action = character.action_of(targets)
        if not self._forces.residual_dim:
            return action
        return torch.cat((action, self._forces.residual_action(self._pull(state, ground))), -1)

    def _pull(self, state: State, ground: Tensor | None) -> Tensor:
        """[N, B, 3] forces that pull the bodies to the clips' next pose, heading frame, in units of the greatest."""
        character = self._character
        qpos, qvel = character.from_base(*self._tracker.wanted(CONTROL_DT + self._tracker.waited))
        wanted, speed = self._seen(*character.forward_kinematics(qpos), qpos, qvel)
        here = (state.body_pos_w, state.body_quat_w, state.qpos, state.qvel)
        position, velocity = self._seen(*(part.float() for part in here))
        if ground is not None:
            position[..., 2] -= ground.float().unsqueeze(-1)
        return _STIFFNESS * (wanted - position) + _DAMPING * (speed - velocity)

    def _seen(self, pos_w: Tensor, quat_w: Tensor, qpos: Tensor, qvel: Tensor) -> tuple[Tensor, Tensor]:
        """Positions and velocities of bodies [N, B, 3] [m], [m/s], heading frame about the point under the root."""
        heading = heading_quat(qpos[:, None, 3:7])
        under = qpos[:, None, :3] * qpos.new_tensor([1.0, 1.0, 0.0])
        velocity_w, _ = self._character.velocities(pos_w, quat_w, qvel)
        return quat_rotate_inverse(heading, pos_w - under), quat_rotate_inverse(heading, velocity_w)
