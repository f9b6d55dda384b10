"""Which joint of a recording is which point of a human body: maps of known skeletons, and the one that fits."""

from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.recording import Skeleton
from murmillo.envs.motion.reading import parse_yaml, read_yaml

SIDES = ("left", "right")
_LIMBS = (("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle"))
_LIMB_POINTS = tuple(f"{side}_{point}" for side in SIDES for limb in _LIMBS for point in limb)
REQUIRED = ("pelvis", "chest", *_LIMB_POINTS)
OPTIONAL = ("head", "left_toe", "right_toe")


@dataclass(frozen=True)
class SkeletonMap:
    """Names of the joints at the points of a body.

    A joint is the point about which its bone turns: `left_elbow` is the joint that moves the left forearm. The pelvis
    is the joint that carries both hips, the chest the last of the spine that carries both shoulders.

    Attributes:
        name: of the skeleton.
        points: joint name of each point in `REQUIRED`, and of those in `OPTIONAL` that there are.
    """

    name: str
    points: dict[str, str]


def load_map(file: Path) -> SkeletonMap:
    """Read a map from YAML: `name`, and under `points` a joint name a point, as the shipped ones in `skeletons/`.

    Raises:
        MotionError: no such file, no YAML, or points that are missing or unknown.
    """
    return _checked_map(read_yaml(file, "a skeleton map", "as those in retarget/skeletons"), str(file))


@cache
def shipped_maps() -> tuple[SkeletonMap, ...]:
    """The maps of known skeletons that come with the package, by file name."""
    folder = files("murmillo.envs.motion.retarget") / "skeletons"
    entries = sorted((entry for entry in folder.iterdir() if entry.name.endswith(".yaml")), key=lambda e: e.name)
    return tuple(_checked_map(parse_yaml(entry.read_bytes()), entry.name) for entry in entries)


def choose_map(skeleton: Skeleton, place: str) -> SkeletonMap:
    """The shipped map that names the most of this skeleton's joints; `place` names the recording in errors.

    Where two name as many, as do Mixamo's and CMU's, the one whose chest is nearer to the shoulders.

    Raises:
        MotionError: no map fits; the line names what the nearest one lacks, and the joints that it may be.
    """
    known = _by_plain_name(skeleton)
    fitting = [one for one in shipped_maps() if not _missing(one, known)]
    if fitting:
        return max(fitting, key=lambda one: (_found(one, known), _depth(skeleton, known[_plain(one.points["chest"])])))
    nearest = max(shipped_maps(), key=lambda one: _found(one, known))
    raise MotionError(_unknown_joints(nearest, skeleton, place, "is nearest; give a skeleton map (YAML, --map)"))


def locate(skeleton_map: SkeletonMap, skeleton: Skeleton, place: str) -> dict[str, int]:
    """Index of the joint of each point of the map that the skeleton has.

    Raises:
        MotionError: a required point is missing, or a limb's joints do not hang on one another.
    """
    known = _by_plain_name(skeleton)
    if _missing(skeleton_map, known):
        raise MotionError(_unknown_joints(skeleton_map, skeleton, place, "was asked for; correct the skeleton map"))
    points = {point: known[_plain(name)] for point, name in skeleton_map.points.items() if _plain(name) in known}
    chains = [tuple(f"{side}_{point}" for point in limb) for side in SIDES for limb in _LIMBS]
    chains += [("chest", f"{side}_shoulder") for side in SIDES] + [("pelvis", f"{side}_hip") for side in SIDES]
    for chain in chains:
        for above, below in pairwise(chain):
            if points[above] not in ancestors(skeleton, points[below]):
                names = [skeleton.names[points[point]] for point in (below, above)]
                raise MotionError(
                    f"{place}: {below} ({names[0]!a}) does not hang on {above} ({names[1]!a}) in this skeleton; "
                    "correct the skeleton map"
                )
    return points


def ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints from this one's parent up to the root."""
    above = []
    while (joint := skeleton.parents[joint]) >= 0:
        above.append(joint)
    return above


def _checked_map(content: Any, place: str) -> SkeletonMap:
    points = content.get("points") if isinstance(content, dict) else None
    if not isinstance(points, dict) or not all(isinstance(name, str) for name in points.values()):
        raise MotionError(f"{place}: is no skeleton map; it needs a joint name for each point under `points:`")
    unknown = [str(point) for point in points if point not in (*REQUIRED, *OPTIONAL)]
    if unknown:
        near = get_close_matches(unknown[0], (*REQUIRED, *OPTIONAL), n=1)
        raise MotionError(f"{place}: unknown point {unknown[0]!a}; {f'is it {near[0]}?' if near else 'leave it out'}")
    missing = [point for point in REQUIRED if point not in points]
    if missing:
        raise MotionError(f"{place}: the point {missing[0]} is missing; name its joint")
    return SkeletonMap(str(content.get("name", Path(place).stem)), points)


def _plain(name: str) -> str:
    """A joint name without what exporters put before it (`mixamorig:Hips`), and without case."""
    return name.rpartition(":")[2].casefold()


def _by_plain_name(skeleton: Skeleton) -> dict[str, int]:
    return {_plain(name): joint for joint, name in enumerate(skeleton.names)}


def _missing(skeleton_map: SkeletonMap, known: dict[str, int]) -> list[str]:
    return [point for point in REQUIRED if _plain(skeleton_map.points[point]) not in known]


def _found(skeleton_map: SkeletonMap, known: dict[str, int]) -> int:
    return sum(_plain(name) in known for name in skeleton_map.points.values())


def _depth(skeleton: Skeleton, joint: int) -> int:
    return len(ancestors(skeleton, joint))


def _unknown_joints(skeleton_map: SkeletonMap, skeleton: Skeleton, place: str, cure: str) -> str:
    known = _by_plain_name(skeleton)
    point = _missing(skeleton_map, known)[0]
    wanted = skeleton_map.points[point]
    taken = {_plain(name) for name in skeleton_map.points.values()}
    near = get_close_matches(_plain(wanted), [name for name in known if name not in taken], n=1, cutoff=0.5)
    guess = f"nearest here is {skeleton.names[known[near[0]]]!a}" if near else f"its root is {skeleton.names[0]!a}"
    return f"{place}: no joint {wanted!a} for {point} ({guess}); the skeleton {skeleton_map.name} {cure}"
