"""Environments of others: their humanoids under the same noise, in their worlds' own course of falls and resets."""

import importlib
import importlib.util
import time
import warnings
from collections.abc import Callable
from statistics import mean
from typing import Any, NamedTuple

import gymnasium

from murmillo.cli.benching.stepping import describe_physics, uniform
from murmillo.cli.benching.turns import Rates
from murmillo.cli.versions import usable_cores

_STEPS = 60
_SUBSTEPS, _TIMESTEP, _DOF = 5, 0.003, 23
"""Of both humanoids, which are one model (Gymnasium's documentation of Humanoid)."""


class Foreign:
    """One of them, warm; a contestant.

    Attributes:
        name: of the suite and its way to many worlds.
        worlds: as many as are simulated together.
    """

    def __init__(self, name: str, env: Any, worlds: int) -> None:
        self.name, self.worlds = name, worlds
        self._env = env
        self._actions = uniform((worlds, *env.action_space.shape[-1:]), 0)
        env.reset()
        for _ in range(20):
            env.step(self._actions)

    def turn(self) -> Rates:
        begin = time.perf_counter()
        for _ in range(_STEPS):
            self._env.step(self._actions)
        return {self.name: self.worlds * _STEPS / (time.perf_counter() - begin)}

    def physics(self) -> str:
        """As it stands now; contacts where Python can read them."""
        worlds = getattr(self._env, "envs", None)
        contacts = mean(world.unwrapped.data.ncon for world in worlds) if worlds else None
        return describe_physics(_TIMESTEP, _SUBSTEPS, _DOF, contacts)

    def close(self) -> None:
        self._env.close()


class Suite(NamedTuple):
    """How to get one.

    Attributes:
        package: that must be installed.
        worlds: by its own documentation's example, more where that is faster.
        make: its vector environment, from the number of worlds.
    """

    package: str
    worlds: int
    make: Callable[[int], Any]

    def why_not(self) -> str | None:
        """Why it cannot take part here."""
        return None if importlib.util.find_spec(self.package) else f"{self.package} is not installed"


def _gymnasium(kind: str) -> Callable[[int], Any]:
    return lambda worlds: gymnasium.make_vec("Humanoid-v5", num_envs=worlds, vectorization_mode=kind)


def _envpool(worlds: int) -> Any:
    envpool = importlib.import_module("envpool")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return envpool.make_gymnasium("Humanoid-v4", num_envs=worlds, num_threads=usable_cores())


SUITES = {
    "Gymnasium Humanoid-v5, sync": Suite("gymnasium", 16, _gymnasium("sync")),
    "Gymnasium Humanoid-v5, async": Suite("gymnasium", 16, _gymnasium("async")),
    "EnvPool Humanoid-v4": Suite("envpool", 64, _envpool),
}
