"""A machine at work in N worlds: where each of them stands, and a log of every transition."""

from typing import NamedTuple

import torch
from torch import Tensor

from murmillo.agents.calm.machine.condition import Quantities
from murmillo.agents.calm.machine.machine import Machine


class Change(NamedTuple):
    """A world that has gone from one state into another.

    Attributes:
        world: its number.
        step: of the machine, counted from 0 when it was bound.
        time: since the world's start [s].
        source, target: names of the states.
        condition: that held, with its numbers.
    """

    world: int
    step: int
    time: float
    source: str
    target: str
    condition: str


class Execution:
    """N worlds that a machine directs.

    Attributes:
        machine: that directs them.
        state: [N] int64 index into its states.
        changes: every transition so far, by step and then by world.
    """

    def __init__(self, machine: Machine, num_worlds: int, dt: float) -> None:
        """
        Args:
            machine: to follow; all worlds begin in its first state.
            num_worlds: N.
            dt: from one step to the next [s].
        """
        self.machine = machine
        self.state = torch.full((num_worlds,), machine.start)
        self.changes: list[Change] = []
        self._dt = dt
        self._step = 0
        self._began, self._entered = torch.zeros(2, num_worlds, dtype=torch.int64)

    def step(self, quantities: Quantities) -> Tensor:
        """The states [N] to act in now. In each world the first transition whose condition holds is made, if any."""
        known = self.known(quantities)
        source = self.state
        reason = torch.full_like(source, -1)
        for number, state in enumerate(self.machine.states):
            waiting = source == number
            for row, transition in enumerate(state.transitions):
                going = waiting & transition.condition(known)
                reason = torch.where(going, row, reason)
                waiting = waiting & ~going
        moved = (reason >= 0).nonzero().flatten()
        self.state, self._entered = source.clone(), self._entered.clone()
        self._entered[moved] = self._step
        for world in moved.tolist():
            self._move(world, int(reason[world]), known["time"][world].item())
        self._step += 1
        return self.state.clone()

    def known(self, quantities: Quantities) -> dict[str, Tensor]:
        """The task's quantities and those of the machine, `OWN_QUANTITIES`, each [N]."""
        times = {"time": self._began, "time_in_state": self._entered}
        return {**quantities, **{name: self._dt * (self._step - since).double() for name, since in times.items()}}

    def reset(self, env_ids: Tensor) -> None:
        """Begin anew in these worlds, [n] int64; the log has no line for it."""
        self.state[env_ids] = self.machine.start
        self._began[env_ids] = self._entered[env_ids] = self._step

    def _move(self, world: int, row: int, time: float) -> None:
        states = self.machine.states
        source = states[int(self.state[world])]
        transition = source.transitions[row]
        self.state[world] = transition.target
        target = states[transition.target].name
        self.changes.append(Change(world, self._step, time, source.name, target, transition.condition.text))
