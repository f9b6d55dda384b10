"""Under which terms clips may be used, which what is learned from them inherits."""

from collections.abc import Sequence
from dataclasses import dataclass

from murmillo.envs.motion.clip import Clip


@dataclass(frozen=True)
class Terms:
    """The licences of some clips together; the strictest binds.

    Attributes:
        licences: each once, sorted.
        sources: likewise.
        redistributable: whether all of the clips may be passed on freely, and so weights trained on them.
    """

    licences: tuple[str, ...]
    sources: tuple[str, ...]
    redistributable: bool

    def __str__(self) -> str:
        verdict = "may be passed on freely" if self.redistributable else "may not be passed on freely"
        return f"licences: {'; '.join(self.licences)}. The clips, and weights trained on them, {verdict}."


def together(*terms: Terms) -> Terms:
    """What several of them come to."""
    return Terms(
        licences=tuple(sorted({licence for each in terms for licence in each.licences})),
        sources=tuple(sorted({source for each in terms for source in each.sources})),
        redistributable=all(each.redistributable for each in terms),
    )


def terms_of(clips: Sequence[Clip]) -> Terms:
    """What the licences of the clips come to."""
    return Terms(
        licences=tuple(sorted({clip.licence for clip in clips})),
        sources=tuple(sorted({clip.source for clip in clips})),
        redistributable=all(clip.redistributable for clip in clips),
    )
