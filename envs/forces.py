"""All that acts on the bodies from outside: residual forces, a user's and a task's push, pushes that come at random."""

from typing import Any

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.config import EnvConfig
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import State
from murmillo.envs.residual import ResidualForces
from murmillo.envs.tasks.pushes import RandomPushes


class OutsideForces:
    """Forces at the bodies' origins of N worlds.

    Attributes:
        residual_dim: components of an action that residual forces take; 0 where there are none.
    """

    def __init__(self, character: Character, config: EnvConfig, num_envs: int) -> None:
        """Raises SuiteError naming the setting that cannot be."""
        self._bodies, self._num_envs = character.bodies, num_envs
        self._residual = None
        if config.residual_force:
            self._residual = ResidualForces(character, config.residual_force, config.residual_reward)
        self.residual_dim = self._residual.action_dim if self._residual else 0
        self._random = RandomPushes(character, config.pushes, num_envs) if config.pushes.every else None
        self._push_w: Tensor | None = None
        self._last: tuple[Tensor, Tensor] | None = None

    def push(self, force_w: Tensor, body: str | None = None) -> None:
        """Push with force_w [N, 3] [N] throughout the next step, at the origin of this body; None is the root.

        Pushes add up.
        """
        if body is not None and body not in self._bodies:
            raise SuiteError(f"body={body}: no such body; there are: {', '.join(self._bodies)}")
        if force_w.shape != (self._num_envs, 3):
            raise SuiteError(f"force_w of shape {tuple(force_w.shape)}: needs {(self._num_envs, 3)}")
        pushed = self._at(0 if body is None else self._bodies.index(body), force_w)
        self._push_w = pushed if self._push_w is None else self._push_w + pushed

    def residual_action(self, force_h: Tensor) -> Tensor:
        """The part [N, residual_dim] of an action whose forces are these of all bodies, heading frame.

        Args:
            force_h: [N, B, 3] in units of the greatest residual force.
        """
        if self._residual is None:
            return force_h.new_zeros(len(force_h), 0)
        return self._residual.action_for(force_h)

    def of_step(self, action: Tensor, state: State, task_push: Tensor | None) -> Tensor | None:
        """[N, B, 3] forces throughout the coming step, world axes [N]; None where nothing acts.

        Args:
            action: [N, residual_dim].
            task_push: [N, 3] on the root [N], beside a user's push.
        """
        if task_push is not None:
            self.push(task_push)
        acting = []
        if self._residual is not None:
            residual = self._residual(action, state)
            self._last = action, residual
            acting.append(residual)
        if self._push_w is not None:
            acting.append(self._push_w)
            self._push_w = None
        if self._random is not None:
            acting.append(self._at(self._random.body, self._random.force_w))
        return sum(acting[1:], start=acting[0]) if acting else None

    def report(self, state: State) -> dict[str, Any]:
        """What info says of the residual forces in the step that led to this state."""
        if self._residual is None or self._last is None:
            return {}
        action, force = self._last
        return {
            "side_rewards": {"residual": self._residual.reward(action).float()},
            "residual_force": force.flatten(1).norm(dim=-1),
            "joint_torque": state.actuator_force.norm(dim=-1),
        }

    def reset(self, env_ids: Tensor, generator: torch.Generator) -> None:
        """New episodes in the worlds env_ids [n]."""
        if self._random is not None:
            self._random.reset(env_ids, generator)

    def advance(self, generator: torch.Generator) -> None:
        """Let a control step pass."""
        if self._random is not None:
            self._random.advance(generator)

    def state_dict(self) -> dict[str, Tensor]:
        """Clocks of the random pushes; the push of a user is not kept."""
        return {} if self._random is None else self._random.state_dict()

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Continue from `state_dict`, bit for bit."""
        if self._random is not None:
            self._random.load_state_dict(state)

    def _at(self, body: int, force_w: Tensor) -> Tensor:
        """[N, B, 3]: the forces [N, 3] at one body."""
        forces = torch.zeros(self._num_envs, len(self._bodies), 3, dtype=torch.float64)
        forces[:, body] = force_w.to(forces)
        return forces
