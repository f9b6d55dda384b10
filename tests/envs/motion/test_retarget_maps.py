"""Skeleton maps: the one that fits is found, and one that does not says which joint is missing."""

import importlib
import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from murmillo.envs.errors import MotionError
from murmillo.envs.motion import retarget
from murmillo.envs.motion.formats.recording import Skeleton
from murmillo.envs.motion.retarget import SkeletonMap, load_map, shipped_maps
from murmillo.envs.motion.retarget.skeleton_map import REQUIRED, choose_map, locate

MAPS = {one.name: one for one in shipped_maps()}
CHAINS = {"elbow": "shoulder", "wrist": "elbow", "knee": "hip", "ankle": "knee", "toe": "ankle"}


def skeleton_of(one: SkeletonMap, prefix: str = "", **renamed: str) -> Skeleton:
    """A skeleton with just the joints of a map, on one another as in a body."""
    points = list(one.points)
    points.sort(key=lambda point: (point != "pelvis", point != "chest"))
    above = {"pelvis": None, "chest": "pelvis", "head": "chest"}
    for side in ("left", "right"):
        above |= {f"{side}_shoulder": "chest", f"{side}_hip": "pelvis"}
        above |= {f"{side}_{low}": f"{side}_{high}" for low, high in CHAINS.items()}
    parents = tuple(-1 if above[point] is None else points.index(above[point]) for point in points)
    names = tuple(prefix + renamed.get(point, one.points[point]) for point in points)
    return Skeleton(names, parents, np.ones((len(points), 3)))


@pytest.mark.parametrize("name", MAPS)
def test_each_shipped_map_is_chosen_for_its_own_skeleton(name: str) -> None:
    skeleton = skeleton_of(MAPS[name])
    # Mixamo's and CMU's differ in the chest alone
    assert choose_map(skeleton, "clip").points == MAPS[name].points
    assert set(REQUIRED) <= set(locate(MAPS[name], skeleton, "clip"))


def test_namespaces_and_case_do_not_matter() -> None:
    assert choose_map(skeleton_of(MAPS["Mixamo"], prefix="mixamorig:"), "clip").points == MAPS["Mixamo"].points
    lower = {point: name.lower() for point, name in MAPS["LAFAN1"].points.items()}
    assert choose_map(skeleton_of(MAPS["LAFAN1"], **lower), "clip").name == "LAFAN1"


def test_of_maps_that_name_as_many_joints_the_one_with_the_higher_chest_is_chosen() -> None:
    """A skeleton of Mixamo has the joint that is the chest in CMU's, below its own."""
    names, parents = skeleton_of(MAPS["Mixamo"]).names, skeleton_of(MAPS["Mixamo"]).parents
    spined = (-1, 0, 1, *(parent + 1 if parent else 0 for parent in parents[2:]))
    skeleton = Skeleton((names[0], "Spine1", *names[1:]), spined, np.ones((len(names) + 1, 3)))
    assert choose_map(skeleton, "clip").name == "Mixamo"


def test_an_unknown_joint_is_named_with_its_neighbour() -> None:
    skeleton = skeleton_of(MAPS["CMU Acclaim"], left_knee="lshin_tibia")
    line = "walk: no joint 'ltibia' for left_knee (nearest here is 'lshin_tibia'); the skeleton CMU Acclaim is nearest"
    with pytest.raises(MotionError, match=re.escape(line)):
        choose_map(skeleton, "walk")


def test_swapped_joints_are_refused() -> None:
    points = MAPS["SMPL"].points
    swapped = SkeletonMap("mine", points | {"left_knee": points["left_ankle"], "left_ankle": points["left_knee"]})
    with pytest.raises(MotionError, match=r"walk: left_ankle \('left_knee'\) does not hang on left_knee"):
        locate(swapped, skeleton_of(MAPS["SMPL"]), "walk")


def test_a_map_is_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({"name": "mine", "points": MAPS["SMPL"].points}), encoding="utf-8")
    assert load_map(file) == SkeletonMap("mine", MAPS["SMPL"].points)


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("a: [1", "is no YAML"),
        ("points: {pelvis: 2001-99-99}", "is no YAML"),
        ("[" * 600, "is no YAML"),
        ("- 1", "is no skeleton map"),
        ("points: {pelvis: [Hips]}", "is no skeleton map"),
        ("points: {left_nee: Knee}", "unknown point 'left_nee'; is it left_knee?"),
        ("points: {pelvis: Hips}", "the point chest is missing"),
    ],
)
def test_a_broken_map_is_refused_in_one_line(tmp_path: Path, content: str, line: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(MotionError, match=re.escape(f"{file}: {line}")) as caught:
        load_map(file)
    assert "\n" not in str(caught.value)


def test_a_missing_map_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"none\.yaml: cannot be read \(No such file"):
        load_map(tmp_path / "none.yaml")


def test_without_mink_the_cure_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MotionError, match=re.escape("pip install murmillo[motion]")):
        importlib.reload(retarget)
