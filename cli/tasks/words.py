"""Which words of the command line are about a task, told without loading what tasks are made of."""

import os
from collections.abc import Sequence

from murmillo.cli.runs import CONFIG

IMITATION = "imitation"
"""The task of a training without a goal, which is what `murmillo train` does by default."""


def value_of(words: Sequence[str], name: str) -> str | None:
    """What the last of the words `name=…` sets; None where there is none."""
    values = [word.partition("=")[2] for word in words if word.lstrip("+").startswith(f"{name}=")]
    return values[-1] if values else None


def are_about_a_task(words: Sequence[str]) -> bool:
    """Whether `murmillo train` is to learn a task: by `task=`, by `low=`, or as the run that it is to take up again."""
    if (task := value_of(words, "task")) is not None:
        return task != IMITATION
    resumed = value_of(words, "run.resume")
    return value_of(words, "low") is not None or (resumed is not None and is_task_run(resumed))


def is_task_run(folder: str | None) -> bool:
    """Whether a run has learned a task; False where there is none, or none that can be read."""
    return "task" in choices_of(folder)


def choices_of(folder: str | None) -> dict[str, str]:
    """What a run's settings were put together from; nothing where there is no run, or none that can be read."""
    import yaml

    path = os.path.join(folder or "", CONFIG)
    try:
        with open(path, encoding="utf-8") as file:
            settings = yaml.safe_load(file)
    except (OSError, ValueError, yaml.YAMLError):
        return {}
    choices = settings.get("choices") if isinstance(settings, dict) else None
    return choices if isinstance(choices, dict) else {}
