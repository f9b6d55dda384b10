"""The styles of CALM's precision training: which skills are commanded, and their encodings."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.precision import StyleReward, encode_styles
from murmillo.cli.errors import CommandError, near_names
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.motion import MotionLibrary

_TRAVEL = 1.0
"""[m] from the first to the last place of a clip, from which it goes somewhere; a step or a leap is shorter."""


def style_names(asked: Sequence[str], library: MotionLibrary) -> list[str]:
    """The skills to command: those that were asked for, or all with a clip that goes somewhere, in the suite's order.

    Raises:
        CommandError: a skill that no clip has, or none that goes anywhere.
    """
    for name in asked:
        if name not in library.skills:
            raise CommandError(
                f"precision.skills=[{','.join(asked)}]: no clip has the skill {name}; "
                f"{near_names(name, list(library.skills))}"
            )
    going = {clip.label for clip in library.clips if np.linalg.norm(clip.qpos[-1, :2] - clip.qpos[0, :2]) > _TRAVEL}
    chosen = [name for name in library.skills if name in (set(asked) or going)]
    if not chosen:
        raise CommandError(
            f"precision.skills=[]: no clip ends more than {_TRAVEL:g} m from where it begins, so that none is taken; "
            f"name the skills to command, of {', '.join(library.skills)}"
        )
    return chosen


def check_style(skill: str, asked: Sequence[str], library: MotionLibrary) -> None:
    """Refuse to command a skill that a policy has not learned.

    Raises:
        CommandError: with those that it has.
    """
    if skill not in (styles := style_names(asked, library)):
        raise CommandError(f"skill={skill}: this run has learned other styles: {', '.join(styles)}")


def style_weights(asked: Sequence[str], library: MotionLibrary) -> Tensor:
    """Probabilities `[K]` of the skills in the environment: the styles all alike, the others never.

    Raises:
        CommandError: as `style_names`.
    """
    chosen = style_names(asked, library)
    return torch.tensor([float(name in chosen) / len(chosen) for name in library.skills])


def style_reward(config: TaskTrainConfig, env: HumanoidVectorEnv, low: CALM) -> StyleReward:
    """The side reward "similarity" of an environment's decisions; equal for equal settings, clips and agents."""
    # a generator of its own: a run that is taken up again has the references that it began with
    generator = torch.Generator().manual_seed(config.seed)
    reference = encode_styles(low, env.demonstrations, len(env.skills), config.precision.samples, generator)
    return StyleReward(reference, config.precision.form)
