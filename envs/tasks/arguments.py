"""Checks of the arguments of tasks. Each raises SuiteError: the argument, its value, what would be right."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from murmillo.envs.errors import SuiteError


def check_choice(name: str, value: Any, choices: Sequence[str]) -> None:
    """Refuse a value that is none of the choices."""
    if value not in choices:
        raise SuiteError(f"task.{name}={value}: no such choice; there are: {', '.join(choices)}")


def check_number(
    name: str, value: Any, *, least: float = -math.inf, above: float = -math.inf, most: float = math.inf
) -> None:
    """Refuse what is not a finite number of at least `least`, greater than `above` and no greater than `most`."""
    if not _is_number(value) or value < least or value <= above or value > most:
        bound = f" above {above:g}" if above > -math.inf else f" of at least {least:g}" if least > -math.inf else ""
        bound += f" up to {most:g}" if most < math.inf else ""
        raise SuiteError(f"task.{name}={value}: needs a number{bound}")


def check_numbers(name: str, value: Any, *, above: float = -math.inf) -> None:
    """Refuse what is not one or more finite numbers greater than `above`."""
    if not _is_sequence(value) or not value or not all(_is_number(v) and v > above for v in value):
        raise SuiteError(f"task.{name}={value}: needs one or more numbers above {above:g}")


def check_range(name: str, value: Any, *, least: float = -math.inf, of: str = "task.") -> None:
    """Refuse what is not two finite numbers, the lowest of at least `least` first; `of` is what has the argument."""
    if not _are_numbers(value, 2) or not least <= value[0] <= value[1]:
        bound = f" of at least {least:g}" if least > -math.inf else ""
        raise SuiteError(f"{of}{name}={value}: needs two numbers{bound}, the lower one first")


def check_steps(name: str, value: Any) -> None:
    """Refuse what is not two whole numbers of control steps, the lower one first."""
    if not are_steps(value):
        raise SuiteError(f"task.{name}={value}: needs two whole numbers of at least 1, the lower one first")


def are_steps(value: Any) -> bool:
    """Whether these are two whole numbers of control steps, the lower one first."""
    return _are_numbers(value, 2) and all(v == int(v) for v in value) and 1 <= value[0] <= value[1]


def check_skill_steps(value: Any) -> None:
    """Refuse a `skill_steps` that is no whole number of control steps; 0 is one."""
    if not _is_number(value) or value < 0 or value != int(value):
        raise SuiteError(f"task.skill_steps={value}: needs a whole number of at least 0")


def check_points(name: str, value: Any) -> None:
    """Refuse what is not two or more points of two numbers each, neighbours apart."""
    if not _is_sequence(value) or len(value) < 2 or not all(_are_numbers(point, 2) for point in value):
        raise SuiteError(f"task.{name}: needs two or more points of two numbers each")
    for i, (a, b) in enumerate(pairwise(value)):
        if math.dist(a, b) < 1e-6:
            raise SuiteError(f"task.{name}: points {i} and {i + 1} are the same; leave one of them out")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _is_sequence(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _are_numbers(value: Any, count: int) -> bool:
    return _is_sequence(value) and len(value) == count and all(_is_number(v) for v in value)
