"""Labels from the names of clips, by a rule."""

import re
from collections.abc import Sequence
from dataclasses import replace

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip

RULES = ("full", "content", "style")
"""`full`: the name without what only counts (`dataset-1_walk_old_001`: walk_old); `content`: the first word of that
(walk); `style`: the words after it (old)."""

_SET = re.compile(r"^(?:dataset-\d+|humanoid3d|amp_humanoid|RL_Avatar)_")
"""What known collections put before every name."""
_COUNTER = re.compile(r"(?:[ _-]\d+|\(\d+\)|(?<=[a-z])0\d)$")
"""A number of its own, or one glued to a word that begins with a zero: walk_001, Idle(0), Combo01, but not Turn180."""
_WORDS = re.compile(r"[ _]+")


def from_names(clips: Sequence[Clip], rule: str = "full") -> list[Clip]:
    """The clips with labels from their names.

    Args:
        rule: one of `RULES`, or a regular expression with groups, whose matches are joined by "_" to be the label.

    Raises:
        MotionError: no such rule and no regular expression, or a name that it does not fit.
    """
    if rule in RULES:
        return [replace(clip, label=_by_rule(clip, rule)) for clip in clips]
    try:
        pattern = re.compile(rule)
    except re.error as error:
        raise MotionError(
            f"rule {rule!a}: is no regular expression ({error}); known rules are {', '.join(RULES)}"
        ) from None
    if pattern.groups == 0:
        raise MotionError(
            f"rule {rule!a}: has no group in brackets to be the label; known rules are {', '.join(RULES)}"
        )
    return [replace(clip, label=_by_pattern(clip, pattern)) for clip in clips]


def _by_rule(clip: Clip, rule: str) -> str:
    name = _SET.sub("", clip.name)
    while (shorter := _COUNTER.sub("", name)) != name and shorter:
        name = shorter
    if rule == "full":
        return name
    words = _WORDS.split(name)
    chosen = words[:1] if rule == "content" else words[1:]
    if not any(chosen):
        raise MotionError(f"clip {clip.name}: its name has one word and so no {rule}; choose another rule")
    return "_".join(chosen)


def _by_pattern(clip: Clip, pattern: re.Pattern[str]) -> str:
    found = pattern.search(clip.name)
    label = "_".join(group for group in found.groups() if group) if found else ""
    if not label:
        raise MotionError(f"clip {clip.name}: the rule {pattern.pattern!a} does not fit its name; correct the rule")
    return label
