"""Combinations of settings that cannot be, refused before anything is made."""

import dataclasses
import math
from collections.abc import Iterator, Mapping
from operator import attrgetter
from typing import Any

from murmillo.agents.common.adaptation import AdaptationConfig
from murmillo.cli.config import TrainConfig
from murmillo.cli.errors import CommandError
from murmillo.cli.seeds import check_seed
from murmillo.envs.character import CONTROL_DT, load_character
from murmillo.envs.motion import load_clips

_LEAST = {
    1: (
        "num_envs",
        "runner.horizon",
        "runner.samples",
        "agent.window",
        "agent.latent_dim",
        "run.measured_worlds",
        "run.keep_every",
    ),
    0: ("runner.max_minutes", "runner.checkpoint_minutes"),
}
"""The least that these settings may be."""


def check_settings(config: TrainConfig) -> None:
    """Refuse what can be seen from the settings alone.

    Raises:
        CommandError: naming the key, what was wrong and what would be right.
    """
    check_training(config, _LEAST)
    check_window(config)
    if config.base is None:
        _check_nothing_adapts(config.agent)
    if config.runner.reward_weights.get("residual") and not config.env.residual_force:
        raise CommandError(
            f"runner.reward_weights.residual={config.runner.reward_weights['residual']}: there are no residual forces "
            "to be sparing with; set env.residual_force (50 N are the published code's), or drop this weight"
        )
    _check_followed(config)


def _check_followed(config: TrainConfig) -> None:
    """Refuse clips that are followed for nothing, and what needs them where none is followed."""
    weight = config.runner.reward_weights.get("tracking", 0.0)
    uses = {"runner.reward_weights.tracking": weight, "guided_start.rounds": config.guided_start.rounds}
    uses["agent.assistance.follows"] = getattr(getattr(config.agent, "assistance", None), "follows", 0.0)
    used = [f"{name}={value:g}" for name, value in uses.items() if value]
    needed = used + ["agent.critic_progress=true"] * getattr(config.agent, "critic_progress", False)
    if needed and not config.env.tracking.follow:
        raise CommandError(f"{needed[0]}: nobody follows a clip; set env.tracking.follow=true")
    if config.env.tracking.follow and not used:
        raise CommandError(
            "env.tracking.follow=true: nothing uses the clips that are followed; give them a weight, "
            "+runner.reward_weights.tracking=3, or a start, guided_start.rounds=8"
        )


def _check_nothing_adapts(agent: AdaptationConfig) -> None:
    """Refuse settings of an adapter where there is none."""
    for field in dataclasses.fields(AdaptationConfig):
        if getattr(agent, field.name) != getattr(AdaptationConfig(), field.name):
            raise CommandError(
                f"agent.{field.name}: what learns from nothing has no adapter; add base=runs/<name> to=…, or drop this"
            )


def check_window(config: Any) -> None:
    """Refuse an environment that shows another number of frames than the agent sees. Raises CommandError."""
    if config.env.window != config.agent.window:
        raise CommandError(
            f"env.window={config.env.window}: the agent sees agent.window={config.agent.window} frames; "
            "set agent.window alone"
        )


def check_training(config: Any, at_least: Mapping[int, tuple[str, ...]]) -> None:
    """Refuse of the settings of any training what cannot be.

    Args:
        config: with an agent that has a `ppo`, an environment and a runner.
        at_least: the least that settings may be, by that; None is allowed.

    Raises:
        CommandError: naming the key, what was wrong and what would be right.
    """
    for least, names in at_least.items():
        for name in names:
            value = attrgetter(name)(config)
            if value is not None and not value >= least:  # so written, a NaN is refused too
                raise CommandError(f"{name}={value}: needs at least {least}")
    for name in ("runner.gamma", "runner.lam"):
        if not 0.0 <= (value := attrgetter(name)(config)) <= 1.0:
            raise CommandError(f"{name}={value}: needs a number from 0 to 1")
    for name, weight in config.runner.reward_weights.items():
        if not math.isfinite(weight):
            raise CommandError(f"runner.reward_weights.{name}={weight}: needs a finite number")
    for name, widths in _hidden("agent", config.agent):
        if any(width < 1 for width in widths) or not (widths or name.endswith("style_hidden")):
            raise CommandError(f"{name}=[{','.join(map(str, widths))}]: needs a width of at least 1 for each layer")
    check_seed("seed", config.seed)
    if config.threads < 0:
        raise CommandError(f"threads={config.threads}: needs a number of threads, or 0 for every core")
    batch = config.num_envs * config.runner.horizon
    if config.agent.ppo.minibatch > batch:
        raise CommandError(
            f"agent.ppo.minibatch={config.agent.ppo.minibatch}: larger than the {batch} samples of an iteration "
            f"(num_envs {config.num_envs} x runner.horizon {config.runner.horizon}); needs at most {batch}"
        )
    if config.env.autoreset != "same_step":
        raise CommandError(f"env.autoreset={config.env.autoreset}: training needs same_step")


def check_clips(config: TrainConfig) -> None:
    """Refuse what the clips do not allow.

    Raises:
        CommandError: a window is longer than every clip, or the clips have another number of labels.
        MotionError: the clips cannot be used.
    """
    clips = load_clips(config.env.motions, load_character(config.env.character), config.env.clips)
    longest = max(clip.duration for clip in clips)
    for name, frames in _windows(config.agent):
        span = (frames - 1) * CONTROL_DT
        if span > longest + 1e-6:
            most = int(longest / CONTROL_DT + 1e-6) + 1
            raise CommandError(
                f"{name}={frames}: {span:.2f} s are longer than every clip of "
                f"motions={config.env.motions} (the longest has {longest:.2f} s); needs at most {most}"
            )
    labels = sorted({clip.label for clip in clips})
    if config.skills is not None and config.skills != len(labels):
        raise CommandError(
            f"skills={config.skills}: the clips of motions={config.env.motions} have {len(labels)} labels "
            f"({', '.join(labels[:8])}{', …' if len(labels) > 8 else ''}); set skills={len(labels)} or null"
        )


def _hidden(name: str, config: Any) -> Iterator[tuple[str, tuple[int, ...]]]:
    """The widths of all hidden layers in an agent's configuration, by the name of their setting."""
    for field in dataclasses.fields(config):
        value, dotted = getattr(config, field.name), f"{name}.{field.name}"
        if dataclasses.is_dataclass(value):
            yield from _hidden(dotted, value)
        elif field.name.endswith("hidden"):
            yield dotted, value


def _windows(agent: Any) -> Iterator[tuple[str, int]]:
    """The lengths of motion [frames] that an agent sees, by the name of their setting."""
    yield "agent.window", agent.window
    if hasattr(agent, "encoder"):  # of whole motions: CALM
        yield "agent.encoder.frames", agent.encoder.frames
