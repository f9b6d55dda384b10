"""Which joint of an unknown skeleton is which part of the body, by the names that skeletons usually have.

Just what is needed to tell up from ahead and a metre from an inch. Retargeting has maps that name every joint.
"""

import re
from dataclasses import dataclass

from murmillo.envs.motion.formats.recording import Skeleton

_PARTS = {
    "toe": ("toe",),
    "foot": ("foot", "ankle"),
    "knee": ("knee", "shin", "tibia", "calf"),
}
"""In this order, so that a LeftToeBase of a foot is a toe."""
_SIDED = "foot|ankle|toe|knee|shin|tibia|calf|leg|lowerleg|upleg|upperleg"
_SIDES = re.compile(rf"(?P<word>left|right)|(?<![a-z])(?P<letter>[lr])(?=$|[ _.-]|(?:{_SIDED}))")


@dataclass(frozen=True)
class Leg:
    """Indices of a leg's joints; the hip is the knee's parent, toe is None where the skeleton ends at the foot."""

    hip: int
    knee: int
    foot: int
    toe: int | None


@dataclass(frozen=True)
class Roles:
    """Index of the head's joint, and the two legs."""

    head: int
    left: Leg
    right: Leg


def find_roles(skeleton: Skeleton) -> Roles | None:
    """The roles, or None where a head or two whole legs cannot be recognised."""
    letters = [re.sub(r"[^a-z]", "", _bare(name)) for name in skeleton.names]
    head = next((j for j, name in enumerate(letters) if name.endswith("head")), None)
    if head is None:
        head = next((j for j, name in enumerate(letters) if name.endswith("neck")), None)
    found: dict[tuple[str, str], int] = {}
    for joint, name in enumerate(skeleton.names):
        role = _side_and_part(name)
        if role is None:
            continue
        side, part = role
        # SMPL has an ankle and, below it, a foot: the toes' base
        part = "toe" if part == "foot" and found.get((side, "foot")) == skeleton.parents[joint] else part
        found.setdefault((side, part), joint)
    legs = {}
    for side in ("left", "right"):
        knee, foot = found.get((side, "knee"), 0), found.get((side, "foot"), 0)
        if not (knee and foot):
            return None
        legs[side] = Leg(skeleton.parents[knee], knee, foot, found.get((side, "toe")))
    return Roles(head, **legs) if head is not None else None


def chain_to_root(skeleton: Skeleton, joint: int) -> list[int]:
    """The joint and its ancestors, without the root."""
    chain = []
    while skeleton.parents[joint] >= 0:
        chain.append(joint)
        joint = skeleton.parents[joint]
    return chain


def _bare(name: str) -> str:
    """Lower case, without a namespace such as "mixamorig:"."""
    return name.rsplit(":", 1)[-1].lower()


def _side_and_part(name: str) -> tuple[str, str] | None:
    bare = _bare(name)
    match = _SIDES.search(bare)
    if match is None or bare.endswith("_end"):
        return None
    side = match["word"] or {"l": "left", "r": "right"}[match["letter"]]
    rest = re.sub(r"[^a-z]", "", bare[: match.start()] + bare[match.end() :])
    part = next((part for part, words in _PARTS.items() if any(word in rest for word in words)), None)
    if part is None and rest.endswith("leg") and "up" not in rest:
        part = "knee"  # the Leg below an UpLeg
    return (side, part) if part is not None else None
