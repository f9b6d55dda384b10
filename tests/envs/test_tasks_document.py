"""docs/tasks.md is what the tasks say of themselves."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from murmillo.envs import SuiteError
from murmillo.envs.tasks import TASKS, Task
from murmillo.envs.tasks.document import PAGE, page

ROOT = Path(__file__).parents[2]


def test_the_committed_page_is_up_to_date():
    assert (ROOT / PAGE).read_text(encoding="utf-8") == page(), "run: python -m murmillo.envs.tasks.document"


@pytest.mark.parametrize("name", TASKS)
def test_the_page_has_every_id(name):
    assert f"`murmillo/{name}-v0`" in page()


@dataclass
class _Config:
    """Arguments.

    Attributes:
        near, far: two distances
            over two lines | [m].
    """

    near: float = 1.0
    far: float = 2.0


class _Odd(Task):
    """A task."""

    config_type = _Config
    goal_dim = 3
    goal_doc = "a place [m] (3)"

    def __init__(self, config: _Config) -> None:
        self.config = config


def test_arguments_are_described_by_the_docstring(monkeypatch):
    monkeypatch.setitem(TASKS, "Odd", _Odd)
    for line in (
        "| [Odd](#odd) | 3 numbers | 0 to 1 | fall, clock | one an episode |",
        "- goal: 3 numbers: a place [m] (3)",
        r"| `far` | `2.0` | two distances over two lines \| [m]. |",
    ):
        assert f"\n{line}\n" in page()


def test_an_argument_without_a_description_is_refused(monkeypatch):
    monkeypatch.setattr(_Config, "__doc__", "Arguments.\n\nAttributes:\n    near: a distance [m].\n")
    monkeypatch.setitem(TASKS, "Odd", _Odd)
    with pytest.raises(SuiteError, match="Odd: argument far has no line under Attributes"):
        page()
