"""Tasks of the suite, one file each."""

from murmillo.envs.markers import Marker
from murmillo.envs.tasks.block import Block
from murmillo.envs.tasks.direction import Direction
from murmillo.envs.tasks.imitation import Imitation
from murmillo.envs.tasks.interface import Task
from murmillo.envs.tasks.location import Location
from murmillo.envs.tasks.navigate import Navigate
from murmillo.envs.tasks.path_follow import PathFollow
from murmillo.envs.tasks.reach import Reach
from murmillo.envs.tasks.recovery import Recovery
from murmillo.envs.tasks.relocation import Relocation
from murmillo.envs.tasks.speed import Speed
from murmillo.envs.tasks.steering import Steering
from murmillo.envs.tasks.strike import Strike

TASKS: dict[str, type[Task]] = {
    "Imitation": Imitation,
    "Reach": Reach,
    "Speed": Speed,
    "Steering": Steering,
    "Location": Location,
    "Direction": Direction,
    "Relocation": Relocation,
    "PathFollow": PathFollow,
    "Strike": Strike,
    "Block": Block,
    "Recovery": Recovery,
    "Navigate": Navigate,
}
"""The task of each gymnasium id `murmillo/<name>-v0`."""

__all__ = ["TASKS", "Imitation", "Marker", "Task"]
