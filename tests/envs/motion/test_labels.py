"""Labels from names, files, similarity, example and chance."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from murmillo.envs.character import load_character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.editing import trim
from murmillo.envs.motion.labels import ClassifierConfig, at_random, classify, cluster, from_file, from_names
from murmillo.envs.motion.labels.features import clip_states

CHARACTER = load_character("sword_shield")
CLIPS = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}


def pieces(name: str, count: int = 4) -> list[Clip]:
    """The middle half of a built-in clip, far from the guard that it begins and ends in, cut into equal clips."""
    clip = CLIPS[name]
    first, length = 0.25 * clip.duration, 0.5 * clip.duration / count
    return [replace(trim(clip, first + i * length, first + (i + 1) * length), name=f"{name}_{i}") for i in range(count)]


@pytest.mark.parametrize(
    ("name", "full", "content", "style"),
    [
        ("dataset-1_walk_not-confident_001", "walk_not-confident", "walk", "not-confident"),
        ("dataset-1_walk-back_old_012", "walk-back_old", "walk-back", "old"),
        ("humanoid3d_getup_facedown", "getup_facedown", "getup", "facedown"),
        ("Atk_2xCombo01", "Atk_2xCombo", "Atk", "2xCombo"),
        ("Idle_Alert(0)", "Idle_Alert", "Idle", "Alert"),
        ("TurnLeft180", "TurnLeft180", "TurnLeft180", None),
        ("02_01", "02", "02", None),
        ("001", "001", "001", None),
    ],
)
def test_rules_for_names(make_clip, name: str, full: str, content: str, style: str | None) -> None:
    clips = [make_clip(name, label="before")]
    assert from_names(clips)[0].label == full
    assert from_names(clips, "content")[0].label == content
    if style is None:
        with pytest.raises(MotionError, match="has one word and so no style"):
            from_names(clips, "style")
    else:
        assert from_names(clips, "style")[0].label == style


def test_an_expression_as_rule(make_clip) -> None:
    clips = [make_clip("take7-walk-slow"), make_clip("take8-run-fast")]
    labelled = from_names(clips, r"-(\w+)-(\w+)")
    assert [clip.label for clip in labelled] == ["walk_slow", "run_fast"]
    assert [clip.name for clip in labelled] == [clip.name for clip in clips]


@pytest.mark.parametrize(
    ("rule", "reason"),
    [("(", "no regular expression"), ("walk", "has no group"), (r"^(\d+)$", "does not fit its name")],
)
def test_rules_that_cannot_be(make_clip, rule: str, reason: str) -> None:
    with pytest.raises(MotionError, match=reason):
        from_names([make_clip("walk")], rule)


@pytest.mark.parametrize(
    ("file", "text"),
    [
        ("labels.json", '{"a": "walk", "b": "run", "c": "more"}'),
        ("labels.yaml", "a: walk\nb: run\n"),
        ("labels.csv", "name,label\na,walk\n\nb, run\n"),
        ("labels.CSV", "a,walk\nb,run\n"),
    ],
)
def test_labels_from_a_file(tmp_path: Path, make_clip, file: str, text: str) -> None:
    (tmp_path / file).write_text(text)
    clips = [make_clip("b"), make_clip("a")]
    assert [clip.label for clip in from_file(clips, tmp_path / file)] == ["run", "walk"]


@pytest.mark.parametrize(
    ("file", "text", "reason"),
    [
        ("absent.json", None, "cannot be read"),
        ("labels.txt", "a,walk", "is no file of labels"),
        ("labels.json", "{", "cannot be understood"),
        ("labels.json", "[]", "holds no labels"),
        ("labels.json", '{"a": 3}', "names and labels as text"),
        ("labels.yaml", "a: [", "cannot be understood"),
        ("labels.yaml", "!!python/object/apply:os.system [ls]", "cannot be understood"),
        ("labels.csv", "a,walk,fast\n", "cannot be understood"),
        ("labels.csv", "a,walk\na,run\n", "cannot be understood"),
        ("labels.csv", "aa,walk\n", "has no label for the clip a; it has 'aa'; add a line"),
        ("labels.json", '{"walk_01": "walk"}', "has no label for the clip a"),
    ],
)
def test_files_that_give_no_labels(tmp_path: Path, make_clip, file: str, text: str | None, reason: str) -> None:
    if text is not None:
        (tmp_path / file).write_text(text)
    with pytest.raises(MotionError, match=reason) as caught:
        from_file([make_clip("a")], tmp_path / file)
    assert str(tmp_path / file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_near_name_is_told(tmp_path: Path, make_clip) -> None:
    (tmp_path / "labels.json").write_text('{"walk_slow": "walk"}')
    with pytest.raises(MotionError, match="it has 'walk_slow'"):
        from_file([make_clip("walk_slow1")], tmp_path / "labels.json")


def test_random_labels_are_even_and_repeat() -> None:
    clips = list(CLIPS.values())[:11]
    labels = [clip.label for clip in at_random(clips, 4, seed=1)]
    assert sorted(Counter(labels).values()) == [2, 3, 3, 3]
    assert sorted(Counter(clip.label for clip in at_random(clips[:5], 4)).values()) == [1, 1, 1, 2]
    assert labels == [clip.label for clip in at_random(clips, 4, seed=1)]
    assert labels != [clip.label for clip in at_random(clips, 4, seed=2)]


@pytest.mark.parametrize("groups", [0, -1, 3])
def test_groups_that_cannot_be(groups: int) -> None:
    clips = list(CLIPS.values())[:2]
    for label in (lambda: at_random(clips, groups), lambda: cluster(clips, CHARACTER, groups)):
        with pytest.raises(MotionError, match=f"groups={groups}: needs a number from 1 to the 2 clips"):
            label()


def test_similar_motions_fall_into_one_cluster() -> None:
    pytest.importorskip("scipy", reason="clustering needs the motion extra: pip install murmillo[motion]")
    still, walking = pieces("guard"), pieces("walk_forward")
    mixed = [clip for pair in zip(still, walking, strict=True) for clip in pair]
    labels = {clip.name: clip.label for clip in cluster(mixed, CHARACTER, 2)}
    assert {labels[clip.name] for clip in still} == {"cluster_01"}
    assert {labels[clip.name] for clip in walking} == {"cluster_02"}


def test_a_classifier_learns_labels_and_tells_how_well() -> None:
    known = [
        replace(clip, label=label)
        for label, name in (("stand", "guard"), ("go", "walk_forward"), ("turn", "turn_left_90"))
        for clip in pieces(name)
    ]
    unknown = pieces("guard", 3) + pieces("walk_forward", 3)
    config = ClassifierConfig(held_out=0.25, epochs=20, hidden=(32,), window=4, hop=2)
    labelled, held = classify(unknown, known, CHARACTER, config)
    assert [clip.label for clip in labelled] == ["stand"] * 3 + ["go"] * 3
    assert (held.clips, held.trained) == (3, 9)
    assert held.accuracy == 1.0
    assert held.commonest < held.correct


def test_accuracy_on_labels_without_meaning_is_low() -> None:
    """Labels dealt at random cannot be learned, so held-out clips must not profit from what was trained on them."""
    clips = at_random([piece for name in ("guard", "walk_forward", "kick") for piece in pieces(name, 8)], 8, seed=3)
    config = ClassifierConfig(held_out=0.5, epochs=60, dropout=0.0, hidden=(64,), window=4, hop=2)
    _, held = classify([], clips, CHARACTER, config)
    assert held.clips == 12
    assert held.accuracy <= 0.5


def test_classifying_does_not_touch_the_global_generator() -> None:
    import torch

    known = [replace(clip, label=name) for name in ("guard", "walk_forward") for clip in pieces(name, 2)]
    before = torch.random.get_rng_state()
    first, _ = classify(known, known, CHARACTER, ClassifierConfig(epochs=2))
    second, _ = classify(known, known, CHARACTER, ClassifierConfig(epochs=2))
    assert torch.equal(torch.random.get_rng_state(), before)
    assert [clip.label for clip in first] == [clip.label for clip in second]


@pytest.mark.parametrize(
    ("labels", "reason"), [(("a", "a", "a"), "at least two labels"), (("a", "b", "c"), "a label that two clips share")]
)
def test_labels_that_nothing_can_be_learned_from(labels: tuple[str, ...], reason: str) -> None:
    known = [replace(clip, label=label) for clip, label in zip(CLIPS.values(), labels, strict=False)]
    with pytest.raises(MotionError, match=reason):
        classify(known, known, CHARACTER)


def test_what_one_clip_has_masked_is_compared_in_none() -> None:
    whole, masked = CLIPS["guard"], replace(CLIPS["kick"], masked=("sword",))
    states = clip_states([whole, masked], CHARACTER)
    sword = slice(120 - 6, 120 - 3)  # of the last six key points' columns
    assert all(bool((state[:, sword] == 0.0).all()) for state in states)
    assert bool((clip_states([whole], CHARACTER)[0][:, sword] != 0.0).any())
