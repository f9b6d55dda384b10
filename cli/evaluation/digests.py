"""What is kept of a recording: enough for every metric, a hundredth of the recording itself."""

import torch
from torch import Tensor

from murmillo.cli.evaluation.protocols import HELD, PUSHED, SWITCHED, SWITCHED_ASE, WINDOW, Protocol
from murmillo.cli.evaluation.recording import Recording
from murmillo.envs.metrics.coverage import majority_clip
from murmillo.envs.metrics.diversity import root_paths
from murmillo.envs.metrics.nearest import ClipMatcher
from murmillo.envs.metrics.transitions import source_and_destination

Digest = dict[str, Tensor]
"""Named fields [n, ...], a row a trajectory; `healed` [n] bool marks those that are to be left out."""

PATH_EVERY = 5
"""Control steps between two points of a root's path."""


def digest(recording: Recording, protocol: Protocol, matcher: ClipMatcher, clips: int) -> Digest:
    """Boil a recording down; `clips` is how many the matcher knows."""
    return {"healed": recording.healed, **_OF[protocol.name](recording, protocol, matcher, clips)}


def _held(recording: Recording, protocol: Protocol, matcher: ClipMatcher, clips: int) -> Digest:
    """The clip that it is like, the window that stands for it, its root's path, and its commands."""
    kept = {
        "matched": majority_clip(matcher.nearest(recording.state), clips),
        "path": root_paths(recording.root_pos_w[:, ::PATH_EVERY], recording.start_quat_w),
        "window": _cut(recording.state, recording.cut),
        "key_pos_w": _cut(recording.key_pos_w, recording.cut),
        "foot_pos_w": _cut(recording.foot_pos_w, recording.cut),
        "touching": _cut(recording.touching, recording.cut),
    }
    for name in ("skill", "clip"):
        if (commanded := getattr(recording.command, name)) is not None:
            kept[name] = commanded
    for name in ("fallen", "torque", "velocity", "residual_force"):
        if (of_steps := getattr(recording, name)) is not None:
            kept[name] = _cut(of_steps, recording.cut, WINDOW - 1)
    return kept


def _switched(recording: Recording, protocol: Protocol, matcher: ClipMatcher, clips: int) -> Digest:
    """The clips that it is like under its first and its second command."""
    source, destination = source_and_destination(matcher.nearest(recording.state), recording.switch, clips)
    return {"source": source, "destination": destination}


def _pushed(recording: Recording, protocol: Protocol, matcher: ClipMatcher, clips: int) -> Digest:
    """How high root and head are after each step since the push began, and whether the body touches the ground."""
    assert protocol.push is not None
    assert recording.head_height is not None
    assert recording.fallen is not None
    begun = protocol.push[0]
    return {
        "root_height": recording.root_pos_w[:, begun + 1 :, 2],
        "head_height": recording.head_height[:, begun + 1 :],
        "fallen": recording.fallen[:, begun:],
    }


_OF = {HELD.name: _held, SWITCHED.name: _switched, SWITCHED_ASE.name: _switched, PUSHED.name: _pushed}


def _cut(series: Tensor, first: Tensor, length: int = WINDOW) -> Tensor:
    """[n, length, ...] the rows from first [n] on of series [n, T, ...]."""
    frames = first[:, None] + torch.arange(length)
    return series[torch.arange(len(series))[:, None], frames]
