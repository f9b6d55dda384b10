"""Combinations of settings that cannot be, refused before anything is made."""

from murmillo.cli.adaptation.base import BaseRun
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.checks import check_training, check_window
from murmillo.cli.errors import CommandError
from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips

LEAST_STYLE_S = 0.5
"""[s] Shorter clips are no style: a step of a walk takes as long."""
_LEAST = {
    2: ("agent.window",),
    1: (
        "num_envs",
        "runner.horizon",
        "runner.samples",
        "run.measured_worlds",
    ),
    0: ("runner.max_minutes", "runner.checkpoint_minutes"),
}
"""The least that these settings may be."""


def check_settings(config: AdaptNetTrainConfig, base: BaseRun | None) -> None:
    """Refuse what can be seen from the settings and the clips.

    Raises:
        CommandError: naming the key, what was wrong and what would be right.
        SuiteError: an argument of the task or a clip cannot be.
    """
    check_training(config, _LEAST)
    config.make_task()
    check_window(config)
    if config.env.features != "links":
        raise CommandError(f"env.features={config.env.features}: AdaptNet sees the links of its last frames; drop this")
    if base is not None:
        if config.warm_start.steps:
            raise CommandError(
                f"warm_start.steps={config.warm_start.steps}: an adaptation begins with what its base can do; drop this"
            )
        base.check_env(config.env)
        base.check_sizes(config.agent)
    clips = load_clips(config.env.motions, load_character(config.env.character), config.env.clips)
    shortest = min(clips, key=lambda clip: clip.duration)
    if shortest.duration < LEAST_STYLE_S:
        raise CommandError(
            f"motions={config.motions}: the clip {shortest.name} has {shortest.duration:.2f} s; a style needs "
            f"{LEAST_STYLE_S:g} s or more"
        )
