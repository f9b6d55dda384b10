"""Which checkpoint and which clips an evaluation is of."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from murmillo.agents.common.checkpoint import TENSORS
from murmillo.cli import runs
from murmillo.envs.motion import Clip

_SHOWN = 3


def checkpoint_digest(folder: Path) -> str:
    """SHA-256 of a checkpoint's tensors, in hexadecimal."""
    with (folder / TENSORS).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def clip_digests(clips: Sequence[Clip]) -> dict[str, str]:
    """SHA-256 of what each clip is to an agent: its frames, their rate and its label; by its name."""
    digests = {}
    for clip in clips:
        digest = hashlib.sha256(f"{clip.fps!r} {clip.label!r} {clip.masked!r} {clip.qpos.shape}".encode())
        digest.update(clip.qpos.tobytes())
        digests[clip.name] = digest.hexdigest()
    return digests


def not_comparable(folder: Path, motions: str | None, own_motions: str, clips: dict[str, str]) -> str | None:
    """Why figures on these clips say nothing of the run beside others, in a sentence; None where they are its own.

    Args:
        folder: of the run, which keeps the digests of its clips since it was begun by a version that does so.
        motions: asked for, if any; own_motions: the run's.
        clips: `clip_digests` of those that are used.
    """
    known = runs.read_json(folder / runs.CLIPS)
    if known is None:
        if motions in (None, own_motions):
            return None
        return f"motions={motions} are not the run's {own_motions}, and it kept no digests to compare them by"
    changed = sorted(name for name in known.keys() | clips.keys() if known.get(name) != clips.get(name))
    if not changed:
        return None
    names = ", ".join(changed[:_SHOWN]) + (" …" if len(changed) > _SHOWN else "")
    count = "1 clip differs" if len(changed) == 1 else f"{len(changed)} clips differ"
    return f"{count} from those that the run learned from ({names})"
