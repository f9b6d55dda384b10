"""Gymnasium ids. They exist after `import murmillo.envs`, or in one go as "murmillo.envs:murmillo/Imitation-v0"."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from typing import Any

import gymnasium

from murmillo.envs.config import EnvConfig
from murmillo.envs.errors import SuiteError
from murmillo.envs.single import HumanoidEnv
from murmillo.envs.tasks import TASKS, Task
from murmillo.envs.vector import HumanoidVectorEnv


def register() -> None:
    """Add the suite's environments to gymnasium's registry, one for each task."""
    for name in TASKS:
        gymnasium.register(
            f"murmillo/{name}-v0",
            entry_point="murmillo.envs.registration:make",
            vector_entry_point="murmillo.envs.registration:make_vector",
            kwargs={"task_name": name},
        )


def make(task_name: str, render_mode: Any = None, task: dict[str, Any] | None = None, **kwargs: Any) -> HumanoidEnv:
    """One world; keyword arguments are those of `EnvConfig`, and `task` has those of the task's own."""
    config = env_config(task_name, **{"threads": 1, **kwargs})
    return HumanoidEnv(config, make_task(task_name, **task or {}), render_mode)


def make_vector(
    task_name: str, num_envs: int = 1, render_mode: Any = None, task: dict[str, Any] | None = None, **kwargs: Any
) -> HumanoidVectorEnv:
    """N worlds; keyword arguments are those of `EnvConfig`, and `task` has those of the task's own."""
    return HumanoidVectorEnv(num_envs, env_config(task_name, **kwargs), make_task(task_name, **task or {}), render_mode)


def make_task(name: str, **arguments: Any) -> Task:
    """The task of this name, with its own arguments.

    Raises:
        SuiteError: there is no such task, or no such argument.
    """
    if name not in TASKS:
        raise SuiteError(f"task={name}: no such task; there are: {', '.join(TASKS)}")
    cls = TASKS[name]
    if cls.config_type is not None:
        return cls(_build(cls.config_type, arguments, "task."))  # type: ignore[call-arg]  those with arguments take them
    if arguments:
        raise SuiteError(f"task.{next(iter(arguments))}: {name} takes no arguments of its own")
    return cls()


def env_config(task_name: str = "Imitation", **kwargs: Any) -> EnvConfig:
    """`EnvConfig` from the settings of a task's id and keyword arguments.

    `fall`, `starts`, `body`, ... may be dicts, or strings in place of their first setting: `body="LongThighs"`. One
    name may stand for a tuple of it: `clips="walk_*"`.

    Raises:
        SuiteError: an argument that there is not, with the nearest that there is, or no dict where one is needed.
    """
    return _build(EnvConfig, _joined(TASKS[task_name].settings, kwargs), "")


def _joined(settings: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """The settings with those over them, dicts within them joined too."""
    joined = {**settings, **over}
    both = [name for name in settings if isinstance(settings[name], Mapping) and isinstance(over.get(name), Mapping)]
    return joined | {name: _joined(settings[name], over[name]) for name in both}


def _build(cls: type, values: dict[str, Any], path: str) -> Any:
    known = {f.name: f for f in fields(cls)}
    nested = {}
    for name, value in values.items():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            hint = f"did you mean {path}{near[0]}?" if near else f"there are: {', '.join(known)}"
            raise SuiteError(f"{path}{name}: no such argument; {hint}")
        factory = known[name].default_factory
        if isinstance(factory, type) and is_dataclass(factory):
            if isinstance(value, str):  # which stands for the first setting
                value = {fields(factory)[0].name: value}
            if isinstance(value, dict):
                value = _build(factory, value, f"{path}{name}.")
        if isinstance(factory, type) and not isinstance(value, factory):
            raise SuiteError(f"{path}{name}={value}: needs values by name, a dict")
        if known[name].default == () and isinstance(value, str):
            value = (value,)
        nested[name] = value
    return cls(**nested)
