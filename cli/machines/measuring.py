"""How well a machine does its task: one attempt in each world."""

from typing import Any, NamedTuple

import torch
from torch import Tensor

from murmillo.agents.calm.machine.execution import Change
from murmillo.cli.machines.scene import MachineScene
from murmillo.envs.character import CONTROL_DT
from murmillo.envs.falls import FallDetector


class Attempts(NamedTuple):
    """One attempt in each of N worlds.

    Attributes:
        time: [N] from the begin to the first moment of success [s]; NaN where there was none.
        fell: [N] bool, whether it fell on the way.
        shares: of the decisions, by the state that they were made in.
        changes: every transition, by step and then by world.
    """

    time: Tensor
    fell: Tensor
    shares: dict[str, float]
    changes: list[Change]


def attempt(scene: MachineScene, seed: int) -> Attempts:
    """One attempt in each world, as long as its time lasts: who has succeeded goes on."""
    scene.reset(seed)
    watch = _Watch(scene)
    scene.world.observe(watch)
    visits = torch.zeros(len(scene.machine.states), dtype=torch.int64)
    changes: list[Change] = []
    while watch.going.any():
        going, known = watch.going, len(scene.execution.changes)
        visits += scene.step()[going].bincount(minlength=len(visits))
        changes += [change for change in scene.execution.changes[known:] if going[change.world]]
    shares = (visits / visits.sum()).tolist()
    names = [state.name for state in scene.machine.states]
    return Attempts(watch.time, watch.fell, dict(zip(names, shares, strict=True)), changes)


class _Watch:
    """Looks at every control step of the first attempt of each world.

    Attributes:
        going: [N] bool, whether the attempt lasts.
        time, fell: as in `Attempts`.
    """

    def __init__(self, scene: MachineScene) -> None:
        self._scene, self._env = scene, scene.world.env
        n = self._env.num_envs
        self._falls = FallDetector(self._env.character, scene.below.config.env.fall)
        self._step = 0
        self.going = torch.ones(n, dtype=torch.bool)
        self.time = torch.full((n,), torch.nan, dtype=torch.float64)
        self.fell = torch.zeros(n, dtype=torch.bool)

    def __call__(self, action: Tensor, results: Any) -> None:
        _, _, terminated, truncated, _ = results
        env, scene = self._env, self._scene
        self._step += 1
        # where an attempt has just ended, the state is already that of the next one
        self.going = self.going & ~torch.as_tensor(terminated) & ~torch.as_tensor(truncated)
        self.fell |= self.going & self._falls(env.state)
        if (success := scene.machine.success) is not None:
            done = success(scene.execution.known(env.task.quantities(env.state)))
            new = self.going & done & self.time.isnan()
            self.time = torch.where(new, self._step * CONTROL_DT, self.time)
