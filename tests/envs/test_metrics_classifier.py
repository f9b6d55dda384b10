"""The classifier of clips: what it holds out, that it learns, and the scores made of what it sees."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from murmillo.envs.errors import SuiteError
from murmillo.envs.metrics.classifier import (
    Classifier,
    ClassifierConfig,
    confusion,
    controllability,
    held_out_split,
    inception_score,
    train_classifier,
)
from murmillo.envs.metrics.windows import windows

QUICK = ClassifierConfig(frames=5, hidden=32, steps=200, batch=64, rate=3e-3, held_out=0.3)


def gaits(clips: int, frames: int = 60) -> list[Tensor]:
    """States [frames, 6] that swing about a pose of each clip's own."""
    generator = torch.Generator().manual_seed(0)
    pose = torch.randn(clips, 1, 6, generator=generator)
    phase = torch.linspace(0.0, 12.0, frames)[:, None] + torch.arange(6)
    return list(pose + 0.5 * torch.sin(phase) + 0.1 * torch.randn(clips, frames, 6, generator=generator))


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    return train_classifier(gaits(5), torch.Generator().manual_seed(1), config=QUICK)


@given(st.integers(1, 200), st.integers(1, 30), st.floats(0.0, 0.9), st.integers(0, 99))
def test_held_out_windows_share_no_frame_with_those_that_train(
    length: int, frames: int, share: float, seed: int
) -> None:
    if length < frames:
        length += frames
    train, held = held_out_split(length, frames, share, torch.Generator().manual_seed(seed))
    seen = {first + k for first in train.tolist() for k in range(frames)}
    kept = {first + k for first in held.tolist() for k in range(frames)}
    assert seen
    assert not seen & kept
    assert max(seen | kept) < length
    assert min(seen | kept) >= 0
    if kept:
        assert len(kept) == max(frames, round(share * length))
    elif share * length <= frames:
        assert length < 2 * frames


def test_every_place_of_a_clip_may_be_held_out() -> None:
    generator = torch.Generator().manual_seed(0)
    places = {held_out_split(12, 3, 0.25, generator)[1].item() for _ in range(200)}
    assert places == set(range(10))


def test_it_knows_clips_that_differ(classifier: Classifier) -> None:
    assert classifier.held_out_windows == 5 * (18 - 5 + 1)
    assert classifier.held_out_accuracy > 0.95
    window = windows([gaits(5)[3]], 5)
    probability = classifier.probabilities(window)
    assert probability.shape == (56, 5)
    torch.testing.assert_close(probability.sum(1), torch.ones(56))
    assert controllability(probability, torch.full((56,), 3)) > 0.9


def test_the_classifier_that_is_given_has_seen_all_of_every_clip() -> None:
    """Each quarter of a clip is a pose of its own: who was not shown one can only guess what it is of."""
    generator = torch.Generator().manual_seed(0)
    clips = [torch.randn(4, 6, generator=generator).repeat_interleave(10, 0) for _ in range(5)]
    found = train_classifier(clips, torch.Generator().manual_seed(1), config=replace(QUICK, held_out=0.25))
    assert found.held_out_accuracy < 0.8
    seen = controllability(found.probabilities(windows(clips, 5)), torch.arange(5).repeat_interleave(36))
    assert seen > 0.85


def test_a_pose_that_is_held_is_none_of_the_motions_and_one_of_the_stands() -> None:
    """Poses and their velocities of three clips that swing and one that stands: who freezes in a swing shows none."""
    generator = torch.Generator().manual_seed(0)
    pose, time = torch.randn(4, 1, 4, generator=generator), torch.linspace(0.0, 20.0, 100)[:, None] + torch.arange(4)
    swing = torch.tensor([0.5, 0.5, 0.5, 0.0])[:, None, None]
    clips = list(torch.cat((pose + swing * torch.sin(time), swing * torch.cos(time)), -1))
    velocities = torch.arange(8) >= 4
    config = replace(QUICK, frames=9, hidden=64, steps=400)
    frozen = windows(clips, 9)[:, 4:5].masked_fill(velocities, 0.0).repeat(1, 9, 1)

    def seen(velocities: Tensor | None, window: Tensor) -> Tensor:
        found = train_classifier(clips, torch.Generator().manual_seed(1), config=config, velocities=velocities)
        return found.probabilities(window).argmax(1).unflatten(0, (4, 92))

    assert (seen(velocities, frozen)[:3] == 4).float().mean() > 0.95
    assert (seen(velocities, frozen)[3] == 3).all()
    assert (seen(velocities, windows(clips, 9)) == torch.arange(4)[:, None]).float().mean() > 0.95
    assert (seen(None, frozen)[:3] == torch.arange(3)[:, None]).float().mean() > 0.8  # what it guards against


def test_who_rests_where_a_clip_stands_is_seen_to_stand() -> None:
    """Twelve clips swing through the pose in which the last one stands, nearly still."""
    generator = torch.Generator().manual_seed(0)
    time = torch.linspace(0.0, 20.0, 100)[:, None]
    pose = torch.randn(1, 4, generator=generator)
    swings = [torch.randn(1, 4, generator=generator) for _ in range(12)]
    moves = [torch.cat((pose + torch.sin(time) * swing, torch.cos(time) * swing), -1) for swing in swings]
    stands = torch.cat((pose + 0.02 * torch.sin(time), torch.zeros(100, 4)), -1)
    clips, velocities = [*moves, stands], torch.arange(8) >= 4
    config = replace(QUICK, frames=9, hidden=64, steps=400)
    found = train_classifier(clips, torch.Generator().manual_seed(1), config=config, velocities=velocities)

    def seen(found: Classifier, away: float) -> float:
        rest = torch.cat((pose + away * torch.randn(200, 4, generator=generator), torch.zeros(200, 4)), -1)
        return (found.probabilities(rest.unsqueeze(1).expand(-1, 9, -1)).argmax(1) == 12).float().mean().item()

    assert seen(found, 0.1) > 0.97
    # a little beside it too, where poses of the swings that are held are no motion otherwise
    strict = train_classifier(
        clips, torch.Generator().manual_seed(1), config=replace(config, stand=0.0), velocities=velocities
    )
    assert seen(found, 0.3) > 0.5 > 0.4 > seen(strict, 0.3)


def test_clips_of_noise_are_told_apart_by_chance_alone() -> None:
    """By a network that could learn every window by heart: held-out windows that it had seen, it would know.

    The bound is four standard deviations of as many windows as do not overlap.
    """
    classes = 4
    generator = torch.Generator().manual_seed(0)
    noise = list(torch.randn(classes, 200, 6, generator=generator))
    config = replace(QUICK, hidden=256, dropout=0.0)
    found = train_classifier(noise, torch.Generator().manual_seed(0), config=config)
    independent = classes * 60 // QUICK.frames
    bound = 4 * math.sqrt(0.25 * 0.75 / independent)
    assert found.held_out_accuracy == pytest.approx(0.25, abs=bound)


def test_shuffled_commands_are_met_by_chance(classifier: Classifier) -> None:
    clips = gaits(5)
    probability = classifier.probabilities(windows(clips, 5))
    commanded = torch.arange(5).repeat_interleave(56)
    assert controllability(probability, commanded) > 0.9
    shuffled = commanded[torch.randperm(280, generator=torch.Generator().manual_seed(0))]
    assert controllability(probability, shuffled) == pytest.approx(0.2, abs=4 * math.sqrt(0.2 * 0.8 / 280))


def test_the_generator_decides_everything(classifier: Classifier) -> None:
    torch.manual_seed(77)
    before = torch.get_rng_state()
    again = train_classifier(gaits(5), torch.Generator().manual_seed(1), config=QUICK)
    assert torch.equal(torch.get_rng_state(), before)
    window = windows(gaits(5), 5)
    assert torch.equal(again.probabilities(window), classifier.probabilities(window))
    other = train_classifier(gaits(5), torch.Generator().manual_seed(2), config=QUICK)
    assert not torch.equal(other.probabilities(window), classifier.probabilities(window))


def test_clips_may_share_a_label() -> None:
    label = torch.tensor([0, 1, 0, 1, 1])
    found = train_classifier(gaits(5), torch.Generator().manual_seed(1), label, QUICK)
    assert found.classes == 2
    assert found.held_out_accuracy > 0.95


def test_clips_too_short_are_named() -> None:
    with pytest.raises(SuiteError, match="clip 1 has 4 frames, a window of the classifier 5"):
        train_classifier([torch.zeros(30, 2), torch.zeros(4, 2)], torch.Generator(), config=QUICK)
    with pytest.raises(SuiteError, match="no clip has room to hold one out; ask for shorter windows"):
        train_classifier([torch.zeros(9, 2), torch.zeros(9, 2)], torch.Generator(), config=QUICK)


def test_confusion_by_hand() -> None:
    probability = torch.tensor([[0.7, 0.2, 0.1], [0.1, 0.2, 0.7], [0.3, 0.6, 0.1], [0.1, 0.8, 0.1]])
    seen = confusion(probability, torch.tensor([0, 0, 0, 2]), 4)
    third = 1 / 3
    expected = [[third, third, third], [0, 0, 0], [0, 1, 0], [0, 0, 0]]
    torch.testing.assert_close(seen, torch.tensor(expected, dtype=torch.float64))


def test_controllability_by_hand() -> None:
    """The likeliest class counts, however sure the classifier is of it."""
    probability = torch.tensor([[0.4, 0.3, 0.3], [0.0, 0.0, 1.0], [0.3, 0.5, 0.2], [0.1, 0.8, 0.1]])
    assert controllability(probability, torch.tensor([0, 2, 0, 1])) == 0.75
    assert controllability(probability, torch.tensor([1, 0, 2, 0])) == 0.0


def test_inception_score_by_hand() -> None:
    probability = torch.tensor([[0.75, 0.25], [0.25, 0.75]])
    divergence = 0.75 * math.log(0.75 / 0.5) + 0.25 * math.log(0.25 / 0.5)
    assert inception_score(probability) == pytest.approx(math.exp(divergence))


def test_inception_score_is_between_one_and_the_number_of_classes() -> None:
    assert inception_score(torch.eye(7).repeat(3, 1)) == pytest.approx(7.0)
    assert inception_score(torch.full((9, 7), 1 / 7)) == pytest.approx(1.0)
    assert inception_score(torch.eye(7)[[2, 2, 2]]) == pytest.approx(1.0)  # sure, and always of the same
