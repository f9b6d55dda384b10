"""Combinations of settings that cannot be, refused before anything is made."""

from murmillo.agents.common.latent_env import LatentEnvConfig
from murmillo.cli.checks import check_training
from murmillo.cli.errors import CommandError
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.low import LowRun

_LEAST = {
    1: (
        "num_envs",
        "runner.horizon",
        "runner.samples",
        "agent.ppo.minibatch",
        "agent.ppo.epochs",
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
