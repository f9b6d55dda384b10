"""The library: draws follow the weights, poses are the clips' own, windows are features of poses."""

from dataclasses import replace

import pytest
import torch

from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip, MotionLibrary
from murmillo.envs.motion.velocities import clip_velocities
from murmillo.envs.observations import character_state
from murmillo.envs.rotations import quat_from_rotvec, quat_mul


@pytest.fixture(scope="module")
def library(character, make_clip) -> MotionLibrary:
    """Four clips of three skills, not in the order of their labels."""
    return MotionLibrary(
        [
            make_clip("slash one", label="slash", frames=31, seed=1, weight=1.0),
            make_clip("walk", frames=16, seed=2, weight=4.0),
            make_clip("slash two", label="slash", frames=61, seed=3, weight=3.0, fps=29.857),
            make_clip("bash", frames=7, seed=4, weight=2.0, fps=120.0),
        ],
        character,
    )


def random(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def features(library: MotionLibrary, clip, time):
    qpos, qvel = library.pose(torch.as_tensor(clip), torch.as_tensor(time, dtype=torch.float64))
    return character_state(library.character, qpos, qvel, library.character.key_positions(qpos))


def test_what_it_says_of_its_clips(library):
    assert library.skills == ("bash", "slash", "walk")
    assert library.clip_skill.tolist() == [1, 2, 1, 0]
    assert library.weight.tolist() == [1.0, 4.0, 3.0, 2.0]
    assert library.duration.tolist() == pytest.approx([1.0, 0.5, 60 / 29.857, 0.05])


def chi_square(counts: torch.Tensor, share: torch.Tensor) -> float:
    expected = share / share.sum() * counts.sum()
    return float(((counts - expected) ** 2 / expected).sum())


def test_clips_are_drawn_by_weight_and_times_evenly(library):
    clip, time = library.sample(20_000, random())
    # three degrees of freedom: above 16.3 once in a thousand
    assert chi_square(torch.bincount(clip, minlength=4).double(), library.weight) < 16.3
    share = time / library.duration[clip]
    assert share.min() >= 0.0
    assert share.max() < 1.0
    # nine degrees of freedom: above 27.9 once in a thousand
    assert chi_square(torch.histc(share, 10, 0.0, 1.0), torch.ones(10, dtype=torch.float64)) < 27.9
    again = library.sample(20_000, random())
    assert torch.equal(again[0], clip)
    assert torch.equal(again[1], time)


def test_a_skill_gives_its_own_clips_by_their_weights(library):
    skill = torch.arange(9_000) % 3
    clip, _ = library.sample(9_000, random(), skill=skill)
    assert torch.equal(library.clip_skill[clip], skill)
    slashes = clip[skill == 1]
    counts = torch.stack([(slashes == 0).sum(), (slashes == 2).sum()]).double()
    assert chi_square(counts, torch.tensor([1.0, 3.0], dtype=torch.float64)) < 10.8


@pytest.mark.parametrize("skill", [[0, 3], [-1, 0], [0]])
def test_unknown_skills_are_refused(library, skill):
    with pytest.raises(MotionError, match="indices of the 3 skills"):
        library.sample(2, random(), skill=torch.tensor(skill))


def test_needs_clips_of_the_character(character, make_clip):
    with pytest.raises(MotionError, match="at least one clip"):
        MotionLibrary([], character)
    with pytest.raises(MotionError, match="dragon"):
        MotionLibrary([replace(make_clip(), character="dragon")], character)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_poses_at_frame_times_are_the_frames(library, dtype):
    """Times in single precision too: they fall a little beside the frames."""
    for i, clip in enumerate(library.clips):
        time = (torch.arange(clip.frames, dtype=torch.float64) / clip.fps).to(dtype)
        qpos, qvel = library.pose(torch.full((clip.frames,), i), time)
        frames = torch.tensor(clip.qpos)
        torch.testing.assert_close(qpos, frames.float(), atol=1e-6, rtol=0.0)
        wanted = clip_velocities(library.character, frames, clip.fps).float()
        torch.testing.assert_close(qvel, wanted, atol=1e-6, rtol=0.0)


def test_times_beyond_the_ends_are_clamped(library):
    qpos, _ = library.pose(torch.tensor([1, 1]), torch.tensor([-3.0, 9.0]))
    torch.testing.assert_close(qpos, torch.tensor(library.clips[1].qpos[[0, -1]]).float())


def test_between_frames(character):
    """Halfway from 0 to 90 degrees is 45, also where the quaternion of the second is given with the other sign."""
    neck = next(joint for joint in character.joints if joint.name == "neck")
    elbow = next(joint for joint in character.joints if joint.name == "left_elbow")
    quarter = quat_from_rotvec(torch.tensor([0.0, torch.pi / 2, 0.0], dtype=torch.float64))
    qpos = character.default_qpos.repeat(3, 1)
    qpos[1, 0] = 0.4
    qpos[1:, neck.qpos] = quarter
    qpos[1, 3:7] = -quarter
    qpos[2, 3:7] = quat_mul(quarter, quarter)
    qpos[1, elbow.qpos] = -1.0
    library = MotionLibrary([clip_of(character, qpos)], character)
    pose, velocity = library.pose(torch.tensor([0, 0]), torch.tensor([0.5, 1.25]) / 30.0)
    eighth = quat_from_rotvec(torch.tensor([0.0, torch.pi / 4, 0.0]))
    torch.testing.assert_close(pose[0, neck.qpos], eighth)
    torch.testing.assert_close(pose[0, 3:7], eighth)
    assert pose[0, 0] == pytest.approx(0.2)
    assert pose[0, elbow.qpos] == pytest.approx(-0.5)
    turned = quat_from_rotvec(torch.tensor([0.0, 1.25 * torch.pi / 2, 0.0]))
    torch.testing.assert_close((pose[1, 3:7] * turned).sum().abs(), torch.tensor(1.0))
    # of the frame before, not interpolated
    torch.testing.assert_close(velocity[:, elbow.dof].squeeze(-1), torch.tensor([-30.0, 30.0]))


def clip_of(character, qpos) -> Clip:
    return Clip("c", character.name, 30.0, qpos.numpy(), "c", "made in a test", "CC0-1.0", True)


def test_a_window_is_the_features_of_the_poses_one_control_step_apart(library):
    clip, time = torch.tensor([0, 2, 2]), torch.tensor([0.71, 1.3, 2.0], dtype=torch.float64)
    window = library.window(clip, time, 5)
    assert window.shape == (3, 5, 120)
    assert window.dtype == torch.float32
    for back in range(5):
        torch.testing.assert_close(window[:, 4 - back], features(library, clip, time - back / 30.0))


def test_before_a_clip_begins_its_first_frame_is_repeated(library):
    window = library.window(torch.tensor([0]), torch.tensor([2.5 / 30.0]), 6)[0]
    first = features(library, [0], [0.0])[0]
    torch.testing.assert_close(window[:3], first.expand(3, 120))
    assert not torch.allclose(window[3], first, atol=1e-3)
    torch.testing.assert_close(window[3], features(library, [0], [0.5 / 30.0])[0])


def test_a_window_may_be_longer_than_its_clip(library):
    window = library.window(torch.tensor([3]), torch.tensor([0.05]), 10)[0]
    torch.testing.assert_close(window[:8], features(library, [3], [0.0])[0].expand(8, 120))


def test_mask_says_which_features_a_clip_made_up(make_clip, character):
    library = MotionLibrary([make_clip("one"), make_clip("two", masked=("shield",))], character)
    assert library.mask is not None
    assert library.mask.sum(-1).tolist() == [0, 3]
    assert MotionLibrary([make_clip("one")], character).mask is None


def test_a_span_lies_within_the_clip_where_it_is_long_enough(make_clip, character):
    library = MotionLibrary([make_clip("short", frames=11), make_clip("long", frames=91)], character)
    clip, time = library.sample(400, torch.Generator().manual_seed(0), span=1.0)
    assert (time[clip == 0] == library.duration[0]).all()
    assert time[clip == 1].min() >= 1.0
    assert time[clip == 1].max() > 2.8


def test_the_middle_of_a_clip(make_clip, character):
    library = MotionLibrary([make_clip("short", frames=11), make_clip("long", frames=91)], character)
    window = library.middle(["long", "short"], 31)
    torch.testing.assert_close(window[:1], library.window(torch.tensor([1]), torch.tensor([2.0]), 31))
    torch.testing.assert_close(window[1:], library.window(torch.tensor([0]), library.duration[:1], 31))
    with pytest.raises(MotionError, match="clip lang: there is none of that name; near it are: long"):
        library.middle(["lang"], 31)


def test_windows_on_frames_are_those_of_the_poses(make_clip, character):
    """Features made once, for clips of 30, 60 and 120 Hz; the same moments a hair off the frames are reckoned anew."""
    clips = [make_clip(f"clip {fps}", frames=fps, seed=fps, fps=float(fps)) for fps in (30, 60, 120)]
    library = MotionLibrary(clips, character)
    clip, time = library.sample(200, random(), span=0.2, on_frames=True)
    frame = time * torch.tensor([30.0, 60.0, 120.0], dtype=torch.float64)[clip]
    torch.testing.assert_close(frame, frame.round(), atol=1e-9, rtol=0)
    assert (time >= 0.2 - 1e-9).all()
    assert len(time.unique()) > 20
    known = library.window(clip, time, 9)
    assert library._frames is not None
    back = torch.arange(8, -1, -1, dtype=torch.float64) / 30
    poses = library.pose(clip.repeat_interleave(9), (time[:, None] - back).flatten())
    reckoned = character_state(character, *poses, character.key_positions(poses[0])).unflatten(0, (200, 9))
    # headings near the vertical multiply what float32 poses are rounded by
    torch.testing.assert_close(known, reckoned, atol=1e-5, rtol=1e-5)


def test_clips_of_odd_rates_have_no_windows_at_hand(library):
    clip, time = library.sample(20, random(), on_frames=True)
    library.window(clip, time, 3)
    assert library._frames is None
