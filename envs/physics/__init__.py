"""Physics engines behind one protocol."""

from collections.abc import Callable
from typing import Literal

import torch

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics.cpu import CpuPhysics
from murmillo.envs.physics.interface import Physics, State
from murmillo.envs.scene import Scene

__all__ = ["ENGINES", "Physics", "State", "make_physics"]


ENGINES = ("cpu", "warp")


def make_physics(
    scene: Scene | Character,
    num_envs: int,
    *,
    backend: Literal["cpu", "warp"] = "cpu",
    threads: int = 0,
    device: str = "auto",
    contacts: int = 0,
    constraints: int = 0,
) -> Physics:
    """N worlds of the scene.

    Args:
        scene: the character with its props, or the character alone.
        backend: "cpu" is MuJoCo's pool of simulations, "warp" is MuJoCo Warp.
        threads: CPU threads of "cpu"; 0 takes every CPU.
        device: of the state: "auto" is the CPU, of "warp" the first GPU; "cuda:1", or "cpu" for Warp's CPU device.
        contacts, constraints: that a world of "warp" has room for (`WarpPhysics`); 0 measures them.

    Raises:
        SuiteError: an unknown or missing engine or device, or a number of worlds or threads that cannot be.
    """
    if backend not in ENGINES:
        raise SuiteError(f"physics={backend}: no such engine; there are: {', '.join(ENGINES)}")
    if num_envs < 1:
        raise SuiteError(f"num_envs={num_envs}: needs at least one world")
    for name, number in (("threads", threads), ("contacts", contacts), ("constraints", constraints)):
        if number < 0:
            raise SuiteError(f"{name}={number}: needs a number, or 0 for {_ZEROS[name]}")
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    if backend == "warp":
        if device == "auto" and not torch.cuda.is_available():  # asked before Warp, which has a line of its own for it
            raise SuiteError(
                "physics=warp: there is no GPU that torch can use; take physics=cpu, or device=cpu for Warp's own CPU "
                "device, which is slow"
            )
        return _warp()(scene, num_envs, device, contacts, constraints)
    if device not in ("auto", "cpu"):
        raise SuiteError(f"device={device}: physics=cpu simulates on the CPU; take physics=warp")
    return CpuPhysics(scene, num_envs, threads)


_ZEROS = {"threads": "every CPU", "contacts": "as many as are measured", "constraints": "as many as are measured"}


def _warp() -> Callable[..., Physics]:
    """The class, whose packages are an extra."""
    try:
        from murmillo.envs.physics.warp import WarpPhysics
    except ImportError as error:
        raise SuiteError(f"physics=warp: {error}; install it with pip install 'murmillo[gpu]'") from error
    return WarpPhysics
