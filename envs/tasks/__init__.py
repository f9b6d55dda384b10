"""Tasks of the suite, one file each."""

from murmillo.envs.tasks.imitation import Imitation
from murmillo.envs.tasks.interface import Task

__all__ = ["Imitation", "Task"]
