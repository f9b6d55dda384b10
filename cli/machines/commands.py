"""What the states of a machine make of an agent: the latents that it follows in each of them."""

from typing import Any

import torch
from torch import Tensor
from torch.nn import functional as F

from murmillo.agents.calm.machine.machine import Clip, Heading, Machine
from murmillo.agents.common.interface import Obs
from murmillo.cli.encodings import encode_middles
from murmillo.cli.machines.heading import HeadingPolicy
from murmillo.envs import HumanoidVectorEnv


class Commands:
    """Latents in each of S states: the encoding of a clip, or what the policy of headings chooses."""

    def __init__(self, machine: Machine, agent: Any, env: HumanoidVectorEnv, heading: HeadingPolicy | None) -> None:
        """
        Args:
            machine: its states.
            agent: CALM's, whose encoder knows the clips.
            env: that the agent acts in.
            heading: the policy; None only where no state goes anywhere.
        """
        self._env, self._policy = env, heading
        commands = [state.command for state in machine.states]
        # one row a state; those of the other kind of state stay 0 and count nowhere
        self._clip = torch.zeros(len(commands), agent.latent_dim)
        self._goes = torch.zeros(len(commands), dtype=torch.bool)
        self._speed = torch.zeros(len(commands), dtype=torch.float64)
        self._style, self._place = torch.zeros(2, len(commands), dtype=torch.int64)
        self._places = list(env.task.place_docs)
        for row, command in enumerate(commands):
            match command:
                case Clip(name):
                    self._clip[row] = encode_middles(agent, env.library, [name])[0]
                case Heading(towards, style, speed) if heading is not None:
                    self._goes[row], self._speed[row] = True, speed
                    self._style[row], self._place[row] = heading.index(style), self._places.index(towards)

    def latents(self, states: Tensor, obs: Obs) -> Tensor:
        """`[N, Z]` for worlds in these states `[N]`, where `obs` is seen."""
        going = self._goes[states]
        if self._policy is None or not going.any():
            return self._clip[states]
        speed, style = self._speed[states], self._style[states]
        chosen = self._policy.latents(obs, self._env.state, self._direction(states), speed, style)
        return torch.where(going.unsqueeze(-1), chosen, self._clip[states])

    def _direction(self, states: Tensor) -> Tensor:
        """[N, 2] unit vectors from each root to the place that its state goes to."""
        state = self._env.state
        named = self._env.task.places(state)
        places = torch.stack([named[name] for name in self._places])
        return F.normalize(places[self._place[states], torch.arange(len(states))] - state.qpos[:, :2], dim=-1)
