"""Physics engines behind one protocol."""

from typing import Literal

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics.cpu import CpuPhysics
from murmillo.envs.physics.interface import Physics, State
from murmillo.envs.scene import Scene

__all__ = ["Physics", "State", "make_physics"]


def make_physics(
    scene: Scene | Character, num_envs: int, *, backend: Literal["cpu"] = "cpu", threads: int = 0
) -> Physics:
    """N worlds of the scene.

    Args:
        scene: the character with its props, or the character alone.
        backend: "cpu" is MuJoCo's pool of simulations.
        threads: CPU threads; 0 takes every CPU.

    Raises:
        SuiteError: an unknown backend, or a number of worlds or threads that cannot be.
    """
    if backend != "cpu":
        raise SuiteError(f"physics={backend}: no such engine; there is: cpu")
    if num_envs < 1:
        raise SuiteError(f"num_envs={num_envs}: needs at least one world")
    if threads < 0:
        raise SuiteError(f"threads={threads}: needs a number of threads, or 0 for every CPU")
    return CpuPhysics(scene if isinstance(scene, Scene) else Scene(scene), num_envs, threads)
