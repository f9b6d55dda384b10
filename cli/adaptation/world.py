"""Where AdaptNet acts: the environment, and the agent in it."""

import dataclasses
from pathlib import Path
from typing import Any, Literal

import torch

from murmillo.agents.adaptnet.agent import AdaptNet
from murmillo.agents.common import checkpoint
from murmillo.agents.common.base import Base
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.cli import foundations, runs
from murmillo.cli.adaptation.base import SETTING, BaseRun
from murmillo.cli.adaptation.config import SCRATCH, AdaptNetTrainConfig, load
from murmillo.cli.adaptation.words import AGENT
from murmillo.cli.blending import Blend
from murmillo.cli.devices import for_playing, for_training
from murmillo.cli.errors import CommandError
from murmillo.envs import HumanoidVectorEnv


def make_env(
    config: AdaptNetTrainConfig,
    num_envs: int,
    render_mode: Literal["rgb_array"] | None = None,
    *,
    training: bool = False,
    **changes: Any,
) -> HumanoidVectorEnv:
    """N worlds of a run, with `changes` of their settings; for training on the device that those say.

    Raises SuiteError where they cannot be.
    """
    settings = dataclasses.replace((for_training if training else for_playing)(config.env), **changes)
    return HumanoidVectorEnv(num_envs, settings, config.make_task(), render_mode)


def make_agent(
    config: AdaptNetTrainConfig,
    base: BaseRun | None,
    env: HumanoidVectorEnv,
    ranks: Ranks = ALONE,
    within: Base | None = None,
) -> tuple[AdaptNet, torch.Generator]:
    """The agent as it is before training, and the generator that it draws from: equal for equal arguments.

    `within` is what a merged run's checkpoint has in place of a base.

    Raises:
        AgentError, CommandError: environment, settings and base do not fit together.
    """
    generator = torch.Generator(env.device).manual_seed(config.seed)
    weights = within
    if base is not None and config.choices["method"] != SCRATCH:
        weights = base.policy(SETTING, env.character)
    return AdaptNet(env, env.demonstrations, config.agent, generator, weights, ranks=ranks), generator


def load_agent(config: AdaptNetTrainConfig, base: BaseRun | None, env: HumanoidVectorEnv, folder: Path) -> AdaptNet:
    """The agent of the run in `folder`, to play in `env`.

    Raises:
        AgentError: the checkpoint is damaged, or made for another environment or base.
    """
    saved = checkpoint.load(folder / runs.LAST)
    checkpoint.check_compatible(saved["meta"], agent_meta(config, env))
    within = Base.within(saved["agent"]) if runs.MERGED in config.choices else None
    agent, _ = make_agent(config, base, env, within=within)
    agent.load_state_dict(saved["agent"])
    return agent


def load_blended(
    config: AdaptNetTrainConfig,
    base: BaseRun | None,
    env: HumanoidVectorEnv,
    folder: Path,
    blend: Blend,
    moved: str | None = None,
) -> AdaptNet:
    """The same, with its adapters as was told; `moved` is where the base of the other run has moved to.

    Raises:
        AgentError: as `load_agent`.
        CommandError: what was told cannot be.
    """

    def load_other(theirs: Path) -> AdaptNet:
        other, other_base = open_run(theirs, moved)
        return load_agent(other, other_base, env, theirs)

    return blend.of(load_agent(config, base, env, folder), AGENT, load_other)


def agent_meta(config: AdaptNetTrainConfig, env: HumanoidVectorEnv) -> dict[str, Any]:
    """What a checkpoint must share with the environment and the agent that it is loaded into."""
    shapes = {name: list(space.shape or ()) for name, space in env.single_observation_space.items()}  # type: ignore[attr-defined]  # it is a Dict
    assert env.single_action_space.shape is not None
    return {
        "agent": config.choices["agent"],
        "stage": config.stage,
        "method": config.choices["method"],
        "character": config.env.character,
        "features": config.env.features,
        "state_shape": shapes["state"],
        "goal_dim": env.task.goal_dim,
        "heights": "heights" in shapes,
        "action_dim": env.single_action_space.shape[0],
        "window": config.agent.window,
    }


def open_run(
    folder: Path, base: str | None = None, motions: str | None = None
) -> tuple[AdaptNetTrainConfig, BaseRun | None]:
    """A trained run's settings, and the run that it adapts.

    Args:
        folder: of the run.
        base: where the run that it adapts has moved; None where it still is.
        motions: the same of the clips.

    Raises:
        AgentError: there is no checkpoint, or it is damaged.
        CommandError: the settings cannot be read, or the base is missing or has changed.
    """
    config = load(folder, [f"base={base}"] if base else [])
    if motions is not None:
        config.env = dataclasses.replace(config.env, motions=motions)
    saved = checkpoint.load(folder / runs.LAST)
    try:
        found = config.find_base()
    except CommandError as error:
        raise CommandError(f"{error}; where it has moved, base=… tells the place") from None
    check_base(found, saved)
    return config, found


def check_base(base: BaseRun | None, saved: dict[str, Any]) -> None:
    """Refuse another base than the one that a checkpoint adapts. Raises CommandError."""
    foundations.check_unchanged(SETTING, base.word if base else "null", base and base.folder, saved)
