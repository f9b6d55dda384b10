"""A session in real time: steps when they are due, and between them what the user has asked for."""

import queue
import threading
import time
from collections.abc import Callable

from murmillo.envs.character import CONTROL_DT
from murmillo.viewer.session import Frame, Session

_FORGIVEN = 0.2
"""[s] A delay up to this is caught up with; a longer one is let go, lest the character rushes after it."""
_PACE_SPAN = 1.0
"""[s] Time over which the pace is measured."""

Command = Callable[[], object]


class Loop:
    """Runs a session at 30 steps a second, or a part of it, and shows every frame.

    Only the thread that calls `run` or `tick` touches the session. Others hand it commands by `do`, and read `pace`.

    Attributes:
        speed: how fast time passes in the session; 1 is real time.
        paused: whether it stands still.
        pace: steps that were done, over those that were due, in the last second; below 1 the machine cannot keep up.
    """

    def __init__(
        self, session: Session, show: Callable[[Frame], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """
        Args:
            session: to be run.
            show: is given every frame; must not wait for anybody.
            clock: gives the time [s].
        """
        self.speed = 1.0
        self.paused = False
        self.pace = 1.0
        self._session, self._show, self._clock = session, show, clock
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._called = threading.Event()
        self._due = self._measured = clock()
        self._steps = 0

    def do(self, command: Command) -> None:
        """Have this done before the next step; from any thread."""
        self._commands.put(command)
        self._called.set()

    def set_speed(self, speed: float) -> None:
        """Let time pass at this speed from the next step on."""
        self.speed = speed
        self._begin_measuring()

    def pause(self, paused: bool) -> None:
        """Stand still, or go on."""
        self.paused = paused
        self._due = self._clock()
        self._begin_measuring()

    def step_once(self) -> None:
        """Let one step pass while it stands still."""
        if self.paused:
            self._session.step()

    def run(self, stop: threading.Event) -> None:
        """Go on until `stop` is set (`do` something to be heard at once)."""
        self._show(self._session.look())
        while not stop.is_set():
            self._called.wait(self.tick())
            self._called.clear()

    def tick(self) -> float:
        """Do what was asked for and what is due; the time until the next step is [s]."""
        changed = self._obey()
        now = self._clock()
        if not self.paused and now >= self._due:
            self._session.step()
            self._steps += 1
            step_s = CONTROL_DT / self.speed
            self._due = now if now - self._due > _FORGIVEN else self._due + step_s
            changed = True
            self._measure(now)
        if changed:
            self._show(self._session.look())
        return _PACE_SPAN if self.paused else max(0.0, self._due - self._clock())

    def _obey(self) -> bool:
        """Do all that waits; whether there was any."""
        obeyed = False
        while not self._commands.empty():
            self._commands.get()()
            obeyed = True
        return obeyed

    def _begin_measuring(self) -> None:
        self._measured, self._steps = self._clock(), 0

    def _measure(self, now: float) -> None:
        elapsed = now - self._measured
        if elapsed >= _PACE_SPAN:
            self.pace = self._steps * CONTROL_DT / (elapsed * self.speed)
            self._begin_measuring()
