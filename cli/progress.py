"""Training as one watches it: a live panel on a terminal, a line every ten seconds elsewhere."""

import sys
from collections.abc import Mapping
from typing import Protocol

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from murmillo.cli.metrics import TRAINING, Metric

PLAIN_INTERVAL_S = 10.0


class Progress(Protocol):
    """A display of the training; a context manager."""

    def show(self, samples: int, seconds: float, scalars: Mapping[str, float]) -> None:
        """Show an iteration: samples and time [s] since this command began, and the logged scalars."""
        ...

    def say(self, text: str) -> None:
        """Print a line that stays."""
        ...

    def __enter__(self) -> "Progress": ...

    def __exit__(self, *error: object) -> None: ...


def make_progress(
    samples: int, begun_at: int, max_minutes: float | None, metrics: tuple[Metric, ...] = TRAINING
) -> Progress:
    """The display for this standard output. `begun_at` are the samples that a resumed run already has."""
    schedule = Schedule(samples, begun_at, max_minutes)
    return LivePanel(schedule, metrics) if sys.stdout.isatty() else PlainLines(schedule, metrics)


class Schedule:
    """How far a run is and how long it will take, by samples or by the clock, whichever ends first."""

    def __init__(self, samples: int, begun_at: int, max_minutes: float | None) -> None:
        self.samples = samples
        self.begun_at = begun_at
        self.max_seconds = None if max_minutes is None else 60.0 * max_minutes

    def rate(self, samples: int, seconds: float) -> float:
        """Samples a second since this command began."""
        return (samples - self.begun_at) / max(seconds, 1e-9)

    def seconds_left(self, samples: int, seconds: float) -> float:
        """[s] to the end of the samples or of the time."""
        by_samples = (self.samples - samples) / max(self.rate(samples, seconds), 1e-9)
        by_clock = by_samples if self.max_seconds is None else self.max_seconds - seconds
        return max(0.0, min(by_samples, by_clock))


class PlainLines:
    """One line every ten seconds, for files and pipes."""

    def __init__(self, schedule: Schedule, metrics: tuple[Metric, ...] = TRAINING) -> None:
        self._schedule, self._metrics = schedule, metrics
        self._shown_at = -PLAIN_INTERVAL_S

    def __enter__(self) -> "PlainLines":
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def say(self, text: str) -> None:
        print(text, flush=True)

    def show(self, samples: int, seconds: float, scalars: Mapping[str, float]) -> None:
        if seconds - self._shown_at < PLAIN_INTERVAL_S:
            return
        self._shown_at = seconds
        parts = [
            f"{samples:,} samples",
            f"{self._schedule.rate(samples, seconds):,.0f}/s",
            f"{clock(self._schedule.seconds_left(samples, seconds))} left",
            *(f"{m.title.lower()} {m.show(scalars[m.scalar])}" for m in self._metrics if m.scalar in scalars),
        ]
        print(", ".join(parts), flush=True)


class LivePanel:
    """A panel that is drawn over itself."""

    def __init__(
        self, schedule: Schedule, metrics: tuple[Metric, ...] = TRAINING, console: Console | None = None
    ) -> None:
        self._schedule, self._metrics = schedule, metrics
        self._live = Live(console=console or Console(), refresh_per_second=4, transient=False)
        self._first: dict[str, float] = {}

    def __enter__(self) -> "LivePanel":
        self._live.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def say(self, text: str) -> None:
        self._live.console.print(text, markup=False, highlight=False)

    def show(self, samples: int, seconds: float, scalars: Mapping[str, float]) -> None:
        self._live.update(self._panel(samples, seconds, scalars))

    def _panel(self, samples: int, seconds: float, scalars: Mapping[str, float]) -> Table:
        schedule = self._schedule
        left = schedule.seconds_left(samples, seconds)
        panel = Table.grid(padding=(0, 2))
        panel.add_row(ProgressBar(total=seconds + left or 1.0, completed=seconds, width=40), f"{clock(left)} left")
        panel.add_row(
            "Samples", f"{samples:,} of {schedule.samples:,}, {schedule.rate(samples, seconds):,.0f} a second"
        )
        for metric in self._metrics:
            if metric.scalar in scalars:
                first = self._first.setdefault(metric.scalar, scalars[metric.scalar])
                now = metric.show(scalars[metric.scalar])
                panel.add_row(metric.title, f"{now}   (began at {metric.show(first)})")
        return panel


def clock(seconds: float) -> str:
    """Minutes and seconds, with hours before them from one hour on: 8:30, 1:02:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
