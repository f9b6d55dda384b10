"""What learners are shown of the clips."""

import torch

from murmillo.envs.motion import MotionLibrary
from murmillo.envs.motion.demonstrations import Demonstrations


def random() -> torch.Generator:
    return torch.Generator().manual_seed(3)


def test_windows_end_at_any_time_and_motions_at_frames(make_clip, character) -> None:
    library = MotionLibrary([make_clip("one", frames=40, seed=1), make_clip("two", frames=90, seed=2)], character)
    demonstrations = Demonstrations(library, character, 5, character.action_dim)
    drawn = demonstrations(64, random())
    clip, time = library.sample(64, random())
    moment = ((240 * time).floor() + 0.5) / 240  # see test_grid.py
    torch.testing.assert_close(drawn["window"], library.window(clip, moment, 5), atol=2e-5, rtol=0)
    assert torch.equal(drawn["skill"], library.clip_skill[clip])
    assert "mask" not in drawn
    motion = demonstrations(64, random(), frames=20)["window"]
    assert motion.shape == (64, 20, 120)
    still = (motion[:, 1:] == motion[:, :-1]).all(-1).any(-1)
    assert not still.any()  # both clips are longer: no first frame is repeated


def test_pairs_are_states_and_the_actions_that_target_the_next_pose(make_clip, character) -> None:
    library = MotionLibrary([make_clip("one", frames=40, seed=1)], character)
    pairs = Demonstrations(library, character, 1, character.action_dim + 45).imitation_pairs(32, random())
    clip, time = library.sample(32, random())
    assert torch.equal(pairs["state"], library.window(clip, time, 1)[:, 0])
    after, _ = library.pose(clip, time + 1 / 30)
    torch.testing.assert_close(pairs["action"][:, :31], character.action_for(after))
    now, _ = library.pose(clip, time)
    assert (pairs["action"][:, :31] - character.action_for(now)).abs().max() > 1e-3
    assert not pairs["action"][:, 31:].any()
    assert torch.equal(pairs["skill"], library.clip_skill[clip])
