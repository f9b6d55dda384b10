"""Watches the scalars of a run and says each known failure once, when it has lasted."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from murmillo.agents.common.failures import FAILURES, WATCHED, Trend, WatchConfig


@dataclass
class Notice:
    """A failure that was said.

    Attributes:
        failure: its short name.
        samples: of the run when it was said.
        text: one line: what was seen, what it means, what to try.
        over: samples of the run when it was over; None while it lasts.
    """

    failure: str
    samples: int
    text: str
    over: int | None = None


class Watch:
    """Says each known failure once when it has lasted, and again only after it was over.

    Attributes:
        notices: all that was said, oldest first.
    """

    def __init__(self, config: WatchConfig) -> None:
        self.config = config
        self.notices: list[Notice] = []
        self._trends = {name: Trend() for name in WATCHED}
        # for how many iterations in a row it has been news that a failure is there, or that it is there no more
        self._news = dict.fromkeys(FAILURES, 0)

    def see(self, scalars: Mapping[str, float]) -> list[str]:
        """Take in an iteration's scalars, "samples" among them; what is to be said now, a line each."""
        for name, scalar in WATCHED.items():
            value = scalars.get(scalar)
            if value is not None and value == value:  # the mean length of no episode is NaN
                self._trends[name].add(value, self.config.memory)

        samples, said = int(scalars["samples"]), []
        for name, failure in FAILURES.items():
            text = failure.find(self._trends, self.config)
            open_notice = self._open(name)
            self._news[name] = self._news[name] + 1 if (text is None) == (open_notice is not None) else 0
            if self._news[name] < failure.patience(self.config) or samples < self.config.quiet:
                continue
            self._news[name] = 0
            if open_notice is not None:
                open_notice.over = samples
            elif text is not None:
                self.notices.append(Notice(name, samples, text))
                said.append(text)
        return said

    def _open(self, failure: str) -> Notice | None:
        """The notice of a failure that lasts."""
        return next((notice for notice in self.notices if notice.failure == failure and notice.over is None), None)

    def state_dict(self) -> dict[str, Any]:
        return {
            "trends": {name: asdict(trend) for name, trend in self._trends.items()},
            "news": dict(self._news),
            "notices": [asdict(notice) for notice in self.notices],
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self._trends |= {name: Trend(**trend) for name, trend in state["trends"].items()}
        self._news |= state["news"]
        self.notices = [Notice(**notice) for notice in state["notices"]]
