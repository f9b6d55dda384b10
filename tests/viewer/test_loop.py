"""Real time: steps when they are due, none while it stands still, commands before the next one."""

import threading
from typing import Any

import pytest

from murmillo.viewer.loop import Loop

DT = 1.0 / 30.0


class Counted:
    """A session that counts its steps and takes no time."""

    def __init__(self) -> None:
        self.steps = 0

    def step(self) -> None:
        self.steps += 1

    def look(self) -> int:
        return self.steps


class Played:
    """A loop in a time of its own."""

    def __init__(self) -> None:
        self.now = 100.0
        self.session: Any = Counted()
        self.shown: list[Any] = []
        self.loop = Loop(self.session, self.shown.append, clock=lambda: self.now)

    def pass_time(self, seconds: float, every: float = 0.001) -> None:
        """Tick now and then for so long."""
        for _ in range(round(seconds / every)):
            self.now += every
            self.loop.tick()


@pytest.mark.parametrize(("speed", "steps"), [(1.0, 60), (0.5, 30), (2.0, 120)])
def test_time_passes_at_the_speed_that_was_asked_for(speed: float, steps: int) -> None:
    played = Played()
    played.loop.set_speed(speed)
    played.pass_time(2.0)
    assert abs(played.session.steps - steps) <= 1
    assert played.shown == list(range(1, played.session.steps + 1))
    assert played.loop.pace == pytest.approx(1.0, abs=0.04)


def test_it_stands_still_and_takes_single_steps() -> None:
    played = Played()
    played.pass_time(0.5)
    before = played.session.steps
    played.loop.do(lambda: played.loop.pause(True))
    played.pass_time(1.0)
    assert played.session.steps == before
    played.loop.do(played.loop.step_once)
    played.pass_time(0.5)
    assert played.session.steps == before + 1 == played.shown[-1]
    played.loop.do(lambda: played.loop.pause(False))
    played.pass_time(0.5)
    assert abs(played.session.steps - before - 16) <= 1  # what was missed is not made up for
    running = played.session.steps
    played.loop.do(played.loop.step_once)  # nothing while it runs
    played.loop.tick()
    assert played.session.steps == running


def test_a_short_delay_is_caught_up_with_and_a_long_one_is_let_go() -> None:
    played = Played()
    played.now += 0.15
    played.pass_time(0.1)
    assert abs(played.session.steps - 7) <= 1
    before = played.session.steps
    played.now += 10.0
    played.pass_time(0.5)
    assert abs(played.session.steps - before - 16) <= 1


def test_the_pace_says_when_it_cannot_keep_up() -> None:
    played = Played()
    played.pass_time(3.0, every=0.1)  # ten steps a second are what this machine can do
    assert played.loop.pace == pytest.approx(1.0 / 3.0, abs=0.05)


def test_commands_are_done_in_order_before_the_next_step_and_what_they_change_is_shown() -> None:
    played = Played()
    done: list[tuple[str, int]] = []
    played.loop.do(lambda: done.append(("first", played.session.steps)))
    played.loop.do(lambda: done.append(("second", played.session.steps)))
    played.loop.tick()
    assert done == [("first", 0), ("second", 0)]
    assert played.shown == [1]
    played.loop.do(lambda: None)
    played.loop.tick()  # not due yet
    assert played.shown == [1, 1]


def test_it_runs_until_it_is_stopped_and_hears_commands_while_it_stands_still() -> None:
    session: Any = Counted()
    stop, heard = threading.Event(), threading.Event()
    loop = Loop(session, lambda frame: None)
    loop.pause(True)
    thread = threading.Thread(target=loop.run, args=(stop,))
    thread.start()
    loop.do(heard.set)
    assert heard.wait(timeout=10.0)
    stop.set()
    loop.do(lambda: None)
    thread.join(timeout=10.0)
    assert not thread.is_alive()
    assert session.steps == 0
