"""A policy acts under commands, and what the metrics need of it is written down."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common.rollout import tensors
from murmillo.cli.evaluation.commands import Command, Commander
from murmillo.cli.evaluation.protocols import PUSH_N, Protocol
from murmillo.envs import HumanoidVectorEnv

_TOUCH_N = 1.0
"""[N] A foot that feels more of the ground stands on it; a body that feels any of it touches it."""

Tick = Callable[[int], None]
"""Told how many control steps, of all worlds together, have been made since it was last told."""


@dataclass(frozen=True)
class Recording:
    """n trajectories of T steps, T + 1 states. Clips that are replayed have no forces: those fields are None.

    Attributes:
        state: [n, T + 1, D].
        root_pos_w: [n, T + 1, 3] [m]; start_quat_w: [n, 1, 4] the root's rotation at the start.
        key_pos_w: [n, T + 1, K, 3] the key points [m].
        foot_pos_w: [n, T + 1, 2, 3] [m]; touching: [n, T + 1, 2] bool, the feet that the ground carries.
        command: the first one of each trajectory.
        switch: [n] steps made under it; all of them where no second one followed.
        cut: [n] first frame of the window that stands for the trajectory.
        healed: [n] bool, simulations that diverged.
        head_height: [n, T + 1] [m]; fallen: [n, T] bool, another body than the feet touches the ground.
        torque, velocity: [n, T, A] of the PD control's axes after each step [N m], [rad/s].
        residual_force: [n, T, J, 3] at each joint, where there are such forces [N], in the heading frame.
    """

    state: Tensor
    root_pos_w: Tensor
    start_quat_w: Tensor
    key_pos_w: Tensor
    foot_pos_w: Tensor
    touching: Tensor
    command: Command
    switch: Tensor
    cut: Tensor
    healed: Tensor
    head_height: Tensor | None = None
    fallen: Tensor | None = None
    torque: Tensor | None = None
    velocity: Tensor | None = None
    residual_force: Tensor | None = None


class Player:
    """Records one policy."""

    def __init__(self, env: HumanoidVectorEnv, agent: Any, commander: Commander, start: str) -> None:
        """`env` resets nothing by itself; `agent` is made for its worlds; `start` is a kind of start."""
        self.env, self.agent, self.commander, self.start = env, agent, commander, start

    @torch.no_grad()
    def record(self, protocol: Protocol, numbers: Tensor, generator: torch.Generator, tick: Tick) -> Recording:
        """One trajectory in each world, by the policy's mean action.

        Args:
            numbers: [n] of the trajectories among all; they go through skills or clips in turn.
            generator: decides everything random, the agent's own draws and the starts included.
        """
        env, agent = self.env, self.agent
        worlds = env.num_envs
        seed = int(torch.randint(2**62, (), generator=generator))
        agent.generator.manual_seed(seed)
        first, second = self.commander.first(agent, numbers), self.commander.random(agent, worlds)
        switch = protocol.draw_switch(worlds, generator)
        cut = protocol.draw_cut(worlds, generator)
        push_w = _push(worlds, generator)
        env.reset(seed=seed, options={"start": self.start})
        agent.reset(torch.arange(worlds))
        start_quat_w = env.state.qpos[:, None, 3:7].float()
        notes = _Notes(env, worlds)
        notes.frame()
        for step in range(protocol.steps):
            if step == 0:
                self._command(first)
            elif (switch == step).any():
                self._command(first.where(switch > step, second))
            if protocol.push is not None and protocol.push[0] <= step < protocol.push[1]:
                env.push(push_w)
            action = agent.act(tensors(env.observation()), deterministic=True).action
            *_, infos = env.step(action.numpy())
            notes.frame()
            notes.effort(action, torch.as_tensor(infos["healed"]))
            tick(worlds)
        return Recording(command=first, switch=switch, cut=cut, start_quat_w=start_quat_w, **notes.fields())

    def _command(self, command: Command) -> None:
        self.agent.follow(command.latent)
        if command.skill is not None:
            for skill in command.skill.unique().tolist():
                self.env.set_skill(skill, (command.skill == skill).nonzero().flatten().tolist())


class _Notes:
    """The fields of a recording, written step by step."""

    def __init__(self, env: HumanoidVectorEnv, worlds: int) -> None:
        character = env.character
        self._env = env
        self._feet = character.body_ids(character.feet)
        self._head = character.bodies.index("head")
        self._others = [body for body in range(len(character.bodies)) if body not in self._feet]
        self._series: dict[str, list[Tensor]] = {}
        self._healed = torch.zeros(worlds, dtype=torch.bool)

    def frame(self) -> None:
        """Of the state as it is now."""
        state = self._env.state
        # a copy, since the observation is a view of its whole history
        self._note("state", torch.as_tensor(self._env.observation()["state"]).clone())
        self._note("root_pos_w", state.qpos[:, :3].float())
        self._note("key_pos_w", state.key_pos_w.float())
        self._note("foot_pos_w", state.body_pos_w[:, self._feet].float())
        self._note("touching", state.ground_force_w[:, self._feet].norm(dim=-1) > _TOUCH_N)
        self._note("head_height", state.body_pos_w[:, self._head, 2].float())

    def effort(self, action: Tensor, healed: Tensor) -> None:
        """Of the step that has just been made by this action [N, A]."""
        state, scale = self._env.state, self._env.config.residual_force
        self._healed |= healed
        self._note("fallen", (state.ground_force_w[:, self._others].norm(dim=-1) > _TOUCH_N).any(-1))
        self._note("torque", state.actuator_force.float())
        self._note("velocity", state.qvel[:, 6:].float())
        if scale:
            residual = action[:, self._env.character.action_dim :].clamp(-1.0, 1.0)
            self._note("residual_force", scale * residual.unflatten(-1, (-1, 3)))

    def fields(self) -> dict[str, Tensor]:
        return {name: torch.stack(values, dim=1) for name, values in self._series.items()} | {"healed": self._healed}

    def _note(self, name: str, value: Tensor) -> None:
        self._series.setdefault(name, []).append(value)


def _push(n: int, generator: torch.Generator) -> Tensor:
    """Horizontal forces [n, 3] [N], uniform in size and direction."""
    size, turn = torch.rand(2, n, generator=generator, dtype=torch.float64)
    size, angle = PUSH_N[0] + (PUSH_N[1] - PUSH_N[0]) * size, 2.0 * torch.pi * turn
    return torch.stack([size * angle.cos(), size * angle.sin(), torch.zeros_like(size)], dim=-1)
