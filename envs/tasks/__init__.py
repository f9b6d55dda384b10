"""Tasks of the suite, one file each."""

from murmillo.envs.tasks.imitation import Imitation
from murmillo.envs.tasks.interface import Marker, Task

TASKS: dict[str, type[Task]] = {"Imitation": Imitation}
"""The task of each gymnasium id `murmillo/<name>-v0`."""

__all__ = ["TASKS", "Imitation", "Marker", "Task"]
