"""What tells one motion from another: the state that policies and discriminators see, over frames."""

from collections.abc import Sequence

import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.library import MotionLibrary


def clip_features(clips: Sequence[Clip], character: Character) -> Tensor:
    """Mean and spread of each state feature over a clip's control steps, standardised over the clips: [C, 2 * 120]."""
    states = clip_states(clips, character)
    return standardise(torch.stack([torch.cat((state.mean(0), state.std(0, correction=0))) for state in states]))


def clip_states(clips: Sequence[Clip], character: Character) -> list[Tensor]:
    """[F, 120] states of each clip at 30 Hz, with those features zero that any of the clips has masked."""
    library = MotionLibrary(clips, character)
    silent = torch.zeros(1, dtype=torch.bool) if library.mask is None else library.mask.any(0)
    states = []
    for index, duration in enumerate(library.duration.tolist()):
        time = torch.arange(int(duration / character.control_dt + 1e-6) + 1, dtype=torch.float64)
        clip = torch.full((len(time),), index)
        states.append(library.window(clip, time * character.control_dt, 1).squeeze(1).masked_fill(silent, 0.0))
    return states


def standardise(values: Tensor) -> Tensor:
    """Columns of values [N, D] with mean 0 and deviation 1; a column that does not vary is 0."""
    mean, spread = values.mean(0), values.std(0, correction=0)
    return (values - mean) / torch.where(spread > 1e-6, spread, torch.inf)
