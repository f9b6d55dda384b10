"""Nearest clips: by hand, against the definition in float64, and unmoved by what must not matter."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.envs.character import CONTROL_DT, Character, load_character
from murmillo.envs.errors import MotionError, SuiteError
from murmillo.envs.metrics.coverage import coverage, majority_clip
from murmillo.envs.metrics.nearest import ClipMatcher
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.observations import character_state
from murmillo.envs.rotations import quat_from_rotvec, quat_mul, quat_rotate

RECORDINGS = Path(__file__).parents[3] / "shared" / "motions" / "sword_shield_ase"


@pytest.fixture
def threads() -> Iterator[None]:
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


@pytest.fixture(scope="module")
def recorded(character: Character) -> list[Tensor]:
    """States of ASE's 87 clips."""
    if not RECORDINGS.is_dir():
        pytest.skip("needs the clips of ASE in ../shared/motions/sword_shield_ase")
    library = MotionLibrary(load_clips(str(RECORDINGS), character), character)
    return [clip_states(library, clip) for clip in range(len(library.clips))]


def clip_states(library: MotionLibrary, clip: int) -> Tensor:
    """[F, D] states of a clip from its first frame on, a control step apart."""
    steps = math.floor(library.duration[clip].item() / CONTROL_DT + 1e-4)
    return library.window(torch.tensor([clip]), torch.tensor([steps * CONTROL_DT]), steps + 1)[0]


def column(*values: float) -> Tensor:
    return torch.tensor(values)[:, None]


def wander(*shape: int, seed: int) -> Tensor:
    """Random walks along the dimension before the last, float64."""
    return torch.randn(*shape, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)).cumsum(-2)


def by_definition(clips: list[Tensor], state: Tensor, dtype: type = np.float64) -> list[int]:
    """Eq. 22 as it is written, for [T + 1, D] states; the features must vary."""
    frames = np.concatenate([clip.numpy() for clip in clips]).astype(np.float64)
    mean, deviation = frames.mean(0), frames.std(0)
    scaled = [((clip.numpy().astype(np.float64) - mean) / deviation).astype(dtype) for clip in clips]
    s = ((state.numpy().astype(np.float64) - mean) / deviation).astype(dtype)
    nearest = []
    for t in range(len(s) - 1):
        each = [
            (((s[t] - clip[:-1]) ** 2).sum(1) + ((s[t + 1] - clip[1:]) ** 2).sum(1)).min().item() for clip in scaled
        ]
        nearest.append(each.index(min(each)))
    return nearest


def near_ties(clips: list[Tensor], count: int, seed: int) -> Tensor:
    """[count, 2, D] transitions almost midway between transitions of two clips, nearer to one by a hair."""
    generator = torch.Generator().manual_seed(seed)
    transitions = []
    for _ in range(count):
        one, other = torch.randperm(len(clips), generator=generator)[:2].tolist()
        frame = torch.randint(min(len(clips[one]), len(clips[other])) - 1, (1,), generator=generator).item()
        start, end = clips[one][frame : frame + 2], clips[other][frame : frame + 2]
        transitions.append(torch.lerp(start, end, 0.5 + 1e-8 * torch.randn(1, generator=generator).item()))
    return torch.stack(transitions)


def test_features_count_by_their_deviation() -> None:
    # deviations 50 and 0.5: (60, 0) is sqrt(1.44) from the first clip and sqrt(0.64 + 4) from the second; without
    # normalisation the second would be nearer
    clips = [torch.tensor([[0.0, 0.0], [0.0, 0.0]]), torch.tensor([[100.0, 1.0], [100.0, 1.0]])]
    state = torch.tensor([[[60.0, 0.0], [60.0, 0.0], [60.0, 0.9], [60.0, 0.9]]])
    assert ClipMatcher(clips).nearest(state).tolist() == [[0, 1, 1]]


def test_a_transition_has_a_direction() -> None:
    matcher = ClipMatcher([column(0, 1), column(1, 0)])
    assert matcher.nearest(column(0, 1, 0, 1)[None]).tolist() == [[0, 1, 0]]


def test_distances_are_squared() -> None:
    # from 0 -> 0: errors 0 and 3 are 9 squared, errors 2 and 2 are 8; as norms it would be 3 and 4
    matcher = ClipMatcher([column(0, 3), column(2, 2)])
    assert matcher.nearest(column(0, 0)[None]).tolist() == [[1]]


def test_no_transition_leads_from_one_clip_or_trajectory_into_the_next() -> None:
    # 5 -> 9 happens only from the end of the first clip to the start of the second; 6 -> 8 is the nearest there is
    matcher = ClipMatcher([column(0, 5), column(9, 20), column(6, 8)])
    assert matcher.nearest(column(5, 9)[None]).tolist() == [[2]]
    assert matcher.nearest(torch.stack([column(0, 5), column(9, 20)])).tolist() == [[0], [1]]


def test_of_equally_near_clips_the_first_counts() -> None:
    one, other = column(0, 1, 5), column(7, 0, 1)
    state = column(0, 1)[None]
    assert ClipMatcher([one, other]).nearest(state).tolist() == [[0]]
    assert ClipMatcher([other, one]).nearest(state).tolist() == [[0]]


def test_identical_clips_count_once_for_matches_and_for_the_normalisation() -> None:
    clips = list(wander(4, 30, 5, seed=0))
    twice = [clips[0], clips[1], clips[0].clone(), clips[2], clips[1].clone(), clips[3]]
    matcher = ClipMatcher(twice)
    assert matcher.distinct == (0, 1, 3, 5)
    state = wander(3, 40, 5, seed=1)
    alone = ClipMatcher(clips).nearest(state)
    assert torch.equal(matcher.nearest(state), torch.tensor(matcher.distinct)[alone])


def test_a_feature_that_is_constant_but_for_rounding_is_left_out() -> None:
    clips, state = list(wander(5, 40, 6, seed=2)), wander(4, 50, 6, seed=3)
    expected = ClipMatcher(clips).nearest(state)
    for constant in (0.0, 0.1, 1000.0):
        noise = [
            torch.cat([clip, constant + 1e-7 * max(constant, 1.0) * wander(len(clip), 1, seed=4).sin()], dim=1)
            for clip in clips
        ]
        other = torch.cat([state, torch.full_like(state[..., :1], constant + 0.3)], dim=-1)
        assert torch.equal(ClipMatcher(noise).nearest(other), expected)


def test_equal_to_the_definition_where_float32_cannot_tell_clips_apart() -> None:
    clips = list(wander(6, 50, 24, seed=5))
    clips[3] = clips[0] + 1e-7 * wander(50, 24, seed=6)
    clips[4] = 30.0 * clips[4]  # outliers, whose norms are large
    state = torch.cat([near_ties(clips, 150, seed=7), clips[0].unfold(0, 2, 1).mT + 1e-7 * wander(49, 2, 24, seed=8)])
    expected = [by_definition(clips, pair)[0] for pair in state]
    assert ClipMatcher(clips).nearest(state).flatten().tolist() == expected
    assert [by_definition(clips, pair, np.float32)[0] for pair in state] != expected


def test_equal_to_the_definition_on_the_recordings(recorded: list[Tensor]) -> None:
    matcher = ClipMatcher(recorded)
    varying = torch.arange(120) != 2  # the root's tangent has no sideways part in its own heading frame
    clips = [recorded[index].double()[:, varying] for index in matcher.distinct]
    walk = recorded[20][:30] + 0.2 * torch.randn(30, 120, generator=torch.Generator().manual_seed(9))
    state = torch.stack([walk, recorded[60][5:35]])
    expected = [[matcher.distinct[index] for index in by_definition(clips, s[:, varying])] for s in state]
    assert matcher.nearest(state).tolist() == expected


@pytest.mark.usefixtures("threads")
def test_threads_and_the_division_into_pieces_change_nothing() -> None:
    clips = list(wander(8, 120, 24, seed=10))
    clips[5] = clips[2] + 1e-7 * wander(120, 24, seed=11)
    state = torch.cat([wander(6, 240, 24, seed=12), torch.stack([clip.repeat(2, 1) for clip in clips])])
    torch.set_num_threads(1)
    whole = ClipMatcher(clips).nearest(state)
    pieces = torch.cat([ClipMatcher(clips).nearest(piece) for piece in state.split(1)])
    torch.set_num_threads(2)
    assert torch.equal(pieces, whole)
    assert torch.equal(ClipMatcher(clips).nearest(state), whole)


def test_the_order_of_the_clips_changes_only_their_numbers() -> None:
    clips, state = list(wander(8, 40, 12, seed=13)), wander(5, 60, 12, seed=14)
    order = torch.randperm(8, generator=torch.Generator().manual_seed(0))
    permuted = ClipMatcher([clips[index] for index in order]).nearest(state)
    assert torch.equal(order[permuted], ClipMatcher(clips).nearest(state))


def test_replayed_recordings_cover_all_clips(recorded: list[Tensor]) -> None:
    matcher = ClipMatcher(recorded)
    assert len(matcher.distinct) == 84
    matched = torch.cat([majority_clip(matcher.nearest(clip[None]), len(recorded)) for clip in recorded])
    assert coverage(matched, matcher.distinct) == 1.0
    assert matched[list(matcher.distinct)].tolist() == list(matcher.distinct)


def test_a_frozen_pose_covers_one_clip() -> None:
    clips = list(wander(10, 30, 12, seed=15))
    matcher = ClipMatcher(clips)
    frozen = clips[7][11].expand(20, 50, 12)
    matched = majority_clip(matcher.nearest(frozen), len(clips))
    assert set(matched.tolist()) == {7}
    assert coverage(matched, matcher.distinct) == 0.1


def test_the_heading_of_a_motion_does_not_matter(character: Character) -> None:
    library = MotionLibrary(load_clips("builtin", character), character)
    matcher = ClipMatcher([clip_states(library, clip) for clip in range(len(library.clips))])
    clip = torch.arange(0, len(library.clips), 3)
    time = 0.5 * library.duration[clip, None] + CONTROL_DT * torch.arange(9)
    qpos, qvel = library.pose(clip.repeat_interleave(9), time.flatten())
    qvel += 0.5 * torch.randn(qvel.shape, generator=torch.Generator().manual_seed(0))  # no match is at distance 0
    turn = quat_from_rotvec(torch.tensor([0.0, 0.0, 2.0])).expand(len(qpos), 4)
    turned_qpos, turned_qvel = qpos.clone(), qvel.clone()
    turned_qpos[:, :3] = quat_rotate(turn, qpos[:, :3])
    turned_qpos[:, 3:7] = quat_mul(turn, qpos[:, 3:7])
    turned_qvel[:, :3] = quat_rotate(turn, qvel[:, :3])
    state, turned = (
        character_state(character, q, v, character.key_positions(q)).unflatten(0, (len(clip), 9))
        for q, v in ((qpos, qvel), (turned_qpos, turned_qvel))
    )
    torch.testing.assert_close(turned, state, rtol=0.0, atol=2e-5)
    assert torch.equal(matcher.nearest(turned), matcher.nearest(state))


def test_no_trajectories_have_no_matches() -> None:
    assert ClipMatcher([column(0, 1)]).nearest(torch.zeros(0, 5, 1)).shape == (0, 4)


@pytest.mark.parametrize(
    ("clips", "message"),
    [
        ([], "no clips"),
        ([torch.zeros(3, 4), torch.zeros(1, 4)], r"clip 1 has states \[1, 4\]"),
        ([torch.zeros(3, 4), torch.zeros(3, 5)], r"clip 1 has states \[3, 5\]; it needs \[F, 4\]"),
        ([torch.full((3, 4), torch.nan)], "clip 0 has a NaN"),
    ],
)
def test_clips_that_cannot_be_matched(clips: list[Tensor], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        ClipMatcher(clips)


def test_trajectories_that_cannot_be_matched(monkeypatch: pytest.MonkeyPatch) -> None:
    matcher = ClipMatcher(list(wander(3, 10, 4, seed=16)))
    with pytest.raises(SuiteError, match=r"\[2, 9, 5\]; the clips need \[n, T \+ 1, 4\]"):
        matcher.nearest(torch.zeros(2, 9, 5))
    for wrong in (torch.nan, torch.inf, 1e9):
        state = torch.zeros(80, 9, 4)
        state[70, 8, 1] = wrong
        with pytest.raises(SuiteError, match="trajectory 70, state 8 has"):
            matcher.nearest(state)
    monkeypatch.setattr(torch, "get_float32_matmul_precision", lambda: "medium")
    with pytest.raises(SuiteError, match="set_float32_matmul_precision"):
        matcher.nearest(torch.zeros(2, 9, 4))
