"""How well an agent that encodes motions has ordered its latents."""

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from murmillo.cli.rollouts import AGES
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.character import CONTROL_DT
from murmillo.envs.metrics.latents import fisher_concentration
from murmillo.envs.motion import MotionLibrary

_EVERY = 0.2
"""[s] from one window of a clip to the next."""


def concentration(env: HumanoidVectorEnv, agent: Any) -> float | None:
    """Fisher concentration of the encodings of windows that slide over the clips.

    None for an agent without encoder, and where no clip is long enough for two windows.
    """
    if not hasattr(agent, "encode"):
        return None
    found = fisher_concentration(*encode_clips(agent, env.library))
    return found if math.isfinite(found) else None


def encode_middles(agent: Any, library: MotionLibrary, names: Sequence[str]) -> Tensor:
    """Encodings [n, Z] of the middles of the clips of these names, each as long as the agent's encoder sees.

    Raises:
        MotionError: a name that no clip has.
    """
    motions = library.middle(names, agent.encoder.frames)
    known = [clip.name for clip in library.clips]
    mask = None if library.mask is None else library.mask[[known.index(name) for name in names]]
    return agent.encode(motions, mask)


def encode_clips(agent: Any, library: MotionLibrary) -> tuple[Tensor, Tensor]:
    """Encodings [n, Z] of windows that slide over the clips, and the clip [n] of each."""
    frames = agent.encoder.frames
    span = (frames - 1) * CONTROL_DT
    latents, clips = [], []
    for number, duration in enumerate(library.duration.tolist()):
        times = torch.arange(min(span, duration), duration + 1e-6, _EVERY, dtype=torch.float64)
        clip = torch.full((len(times),), number)
        mask = None if library.mask is None else library.mask[clip]
        latents.append(agent.encode(library.window(clip, times, frames), mask))
        clips.append(clip)
    return torch.cat(latents), torch.cat(clips)


def section(measures: dict[str, Any]) -> str:
    """The report's section, Markdown; empty for an agent without encoder."""
    known = {age: measured.get("concentration") for age, measured in measures.items()}
    rows = [f"| {AGES[age]} | {value:.3f} |" for age, value in known.items() if value is not None]
    if not rows:
        return ""
    return "\n".join(
        [
            "## Does the encoder know the clips apart?",
            "",
            "Fisher concentration (CALM, eq. 9): how far the encodings of a clip's windows lie from each other, over "
            "how far they lie from those of all clips. Down is good: 1 means that clips do not matter. The table by "
            "minute has the discriminator's score of the agent under its own latent and under another's.",
            "",
            "| policy | Fisher concentration |",
            "|---|---:|",
            *rows,
        ]
    )
