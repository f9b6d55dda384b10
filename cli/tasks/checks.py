"""Combinations of settings that cannot be, refused before anything is made."""

from dataclasses import asdict
from typing import Any

from murmillo.agents.calm.precision import PrecisionConfig
from murmillo.agents.common.latent_env import LatentEnvConfig
from murmillo.cli.checks import check_training
from murmillo.cli.errors import CommandError
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.names import commands_skills, task_names

_LEAST = {
    1: (
        "num_envs",
        "runner.horizon",
        "runner.samples",
        "run.measured_worlds",
    ),
    0: ("runner.max_minutes", "runner.checkpoint_minutes"),
}
"""The least that these settings may be."""

_OWN_DECISIONS = LatentEnvConfig(steps=1, terms=())


def check_settings(config: TaskTrainConfig, below: LowRun | None) -> None:
    """Refuse what can be seen from the settings alone.

    Raises:
        CommandError: naming the key, what was wrong and what would be right.
        SuiteError: an argument of the task cannot be.
    """
    check_training(config, _LEAST)
    task = config.make_task()
    if below is None:
        if config.latent_env != _OWN_DECISIONS:
            raise CommandError("latent_env: low=none has no latents to decide on; drop this setting, or name a run")
    else:
        below.check_env(config.env)
    if config.agent.gumbel is not None and (config.choices["agent"] != "case" or task.skill_steps):
        raise CommandError(
            f"agent.gumbel={config.agent.gumbel}: this policy chooses no labels; only one over a run of agent=case "
            "does, in a task where no user commands them"
        )
    if not config.commands_styles:
        for name, value in asdict(PrecisionConfig()).items():
            if (asked := getattr(config.precision, name)) != value:
                tasks = ", ".join(task for task in task_names() if commands_skills(task))
                raise CommandError(
                    f"precision.{name}={_shown(asked)}: no styles are commanded here; only over a run of agent=calm, "
                    f"in a task that commands skills ({tasks})"
                )


def _shown(value: Any) -> str:
    """As on the command line."""
    return f"[{','.join(value)}]" if isinstance(value, tuple) else str(value)
