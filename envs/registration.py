"""Gymnasium ids. They exist after `import murmillo.envs`, or in one go as "murmillo.envs:murmillo/Imitation-v0"."""

from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Any

import gymnasium

from murmillo.envs.config import EnvConfig
from murmillo.envs.errors import SuiteError
from murmillo.envs.single import HumanoidEnv
from murmillo.envs.tasks import Imitation
from murmillo.envs.vector import HumanoidVectorEnv


def register() -> None:
    """Add the suite's environments to gymnasium's registry."""
    gymnasium.register(
        "murmillo/Imitation-v0",
        entry_point="murmillo.envs.registration:imitation",
        vector_entry_point="murmillo.envs.registration:imitation_vector",
    )


def imitation(render_mode: Any = None, **kwargs: Any) -> HumanoidEnv:
    """One world; keyword arguments are those of `EnvConfig`."""
    return HumanoidEnv(env_config(threads=kwargs.pop("threads", 1), **kwargs), Imitation(), render_mode)


def imitation_vector(num_envs: int = 1, render_mode: Any = None, **kwargs: Any) -> HumanoidVectorEnv:
    """N worlds; keyword arguments are those of `EnvConfig`."""
    return HumanoidVectorEnv(num_envs, env_config(**kwargs), Imitation(), render_mode)


def env_config(**kwargs: Any) -> EnvConfig:
    """`EnvConfig` from keyword arguments, in which `fall` and `starts` may be dicts.

    Raises:
        SuiteError: an argument that there is not, with the nearest that there is.
    """
    return _build(EnvConfig, kwargs, "")


def _build(cls: type, values: dict[str, Any], path: str) -> Any:
    known = {f.name: f for f in fields(cls)}
    nested = {}
    for name, value in values.items():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {path}{near[0]}?" if near else f"there are: {', '.join(known)}"
            raise SuiteError(f"{path}{name}: no such argument; {hint}")
        factory = known[name].default_factory
        if isinstance(value, dict) and isinstance(factory, type) and is_dataclass(factory):
            value = _build(factory, value, f"{path}{name}.")
        nested[name] = value
    return cls(**nested)
