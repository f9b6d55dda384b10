"""How far an evaluation is and how long it will take: a bar on a terminal, a line every ten seconds elsewhere."""

import sys
import time
from typing import Protocol

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from murmillo.cli.progress import PLAIN_INTERVAL_S, clock


class Display(Protocol):
    """A context manager; `total` steps are to be made."""

    def __enter__(self) -> "Display": ...

    def __exit__(self, *error: object) -> None: ...

    def doing(self, text: str) -> None:
        """Say what is done now."""
        ...

    def advance(self, steps: int) -> None: ...


def make_display(total: int) -> Display:
    """The display for this standard output; `total` control steps of all worlds are to be recorded."""
    return Bar(total) if sys.stdout.isatty() else PlainLines(total)


class Bar:
    """A bar that is drawn over itself."""

    def __init__(self, total: int) -> None:
        columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %")
        self._progress = Progress(*columns, TimeRemainingColumn(), TextColumn("left"), transient=True)
        self._task = self._progress.add_task("", total=max(total, 1), completed=0 if total else 1)

    def __enter__(self) -> "Bar":
        self._progress.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._progress.stop()

    def doing(self, text: str) -> None:
        self._progress.update(self._task, description=text)

    def advance(self, steps: int) -> None:
        self._progress.advance(self._task, steps)


class PlainLines:
    """Lines for files and pipes."""

    def __init__(self, total: int) -> None:
        self._total, self._done, self._text = total, 0, ""
        self._begun = self._shown = time.monotonic()

    def __enter__(self) -> "PlainLines":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def doing(self, text: str) -> None:
        self._text = text

    def advance(self, steps: int) -> None:
        self._done += steps
        now = time.monotonic()
        if now - self._shown < PLAIN_INTERVAL_S:
            return
        self._shown = now
        left = (now - self._begun) * (self._total / self._done - 1.0)
        print(f"evaluating: {self._text}, {100 * self._done / self._total:.0f} %, {clock(left)} left", flush=True)
