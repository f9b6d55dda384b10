"""What the tasks are called on the command line: `task=path_follow` is the environment `murmillo/PathFollow-v0`."""

import dataclasses
import re
from typing import Any

from murmillo.cli.errors import CommandError, near_names
from murmillo.envs.tasks import TASKS, Imitation, Task

_KNOWN = {re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower(): cls for name, cls in TASKS.items() if cls is not Imitation}


def task_names() -> list[str]:
    """All of them, in the suite's order."""
    return list(_KNOWN)


def task_class(name: str) -> type[Task]:
    """The task of this name.

    Raises:
        CommandError: there is none; with the near names.
    """
    if name not in _KNOWN:
        raise CommandError(f"task={name}: there is no such task; {near_names(name, ['imitation', *_KNOWN])}")
    return _KNOWN[name]


def commands_skills(name: str) -> bool:
    """Whether the task of this name tells its policy the skill by which it is to be done.

    Raises:
        CommandError: there is none of this name.
    """
    arguments: Any = task_class(name).config_type
    return any(field.name == "skill_steps" for field in dataclasses.fields(arguments))
