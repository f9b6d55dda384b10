"""Where in the clips episodes begin."""

import gymnasium
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.character import load_character
from murmillo.envs.moments import StartingMoments
from murmillo.envs.motion import MotionLibrary, load_clips


@pytest.fixture(scope="module")
def library() -> MotionLibrary:
    character = load_character()
    return MotionLibrary(load_clips("builtin", character, ["guard", "kick"]), character)


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def test_as_long_as_all_fall_or_none_is_asked_for_all_moments_are_alike(library, generator):
    for adaptive in (0.0, 1.0):
        clip, time = StartingMoments(library, adaptive).draw(20000, generator)
        assert (clip == 0).double().mean() == pytest.approx(0.5, abs=0.02)  # their weights, not their lengths
        for k in range(2):
            share = time[clip == k] / library.duration[k]
            assert torch.histc(share.float(), 4, 0.0, 1.0).div(len(share)).sub(0.25).abs().max() < 0.02


def test_more_often_where_episodes_fell(library, generator):
    moments = StartingMoments(library, 0.5)
    clip, time = moments.draw(2000, generator)
    hard = (clip == 1) & (time > 1.0) & (time < 1.5)
    for _ in range(20):
        moments.note(moments.stretch(clip, time), hard)
    drawn, at = moments.draw(20000, generator)
    there = (drawn == 1) & (at >= 1.0) & (at < 1.5)
    by_weight = 0.5 * 0.5 / library.duration[1].item()
    assert there.double().mean() == pytest.approx(0.5 + 0.5 * by_weight, abs=0.02)


def test_stretches_and_what_is_drawn_lie_in_their_clips(library, generator):
    moments = StartingMoments(library, 1.0)
    clip, time = moments.draw(5000, generator)
    assert (time <= library.duration[clip]).all()
    stretch = moments.stretch(clip, time)
    assert set(stretch.tolist()) == set(range(len(moments.falls)))
    end = moments.stretch(torch.tensor([0, 1]), library.duration)
    assert end.tolist() == [stretch[clip == 0].max(), len(moments.falls) - 1]


def test_a_share_of_falls_is_that_of_late_episodes(library):
    moments = StartingMoments(library, 1.0)
    for _ in range(200):
        moments.note(torch.tensor([3, 3, 5]), torch.tensor([True, False, False]))
    assert moments.falls[3].item() == pytest.approx(0.5, abs=0.05)
    assert moments.falls[5].item() == pytest.approx(0.0, abs=1e-3)
    assert moments.falls[0].item() == 1.0
    moments.note(torch.tensor([], dtype=torch.int64), torch.tensor([], dtype=torch.bool))


@pytest.mark.parametrize("falling", [False, True])
def test_the_environment_counts_how_episodes_end(falling: bool):
    """Those of three steps end by the clock; a clip that is lost at once ends as by a fall."""
    env = gymnasium.make_vec(
        "murmillo/Imitation-v0",
        num_envs=20,
        threads=1,
        clips=("guard", "kick"),
        episode_steps=300 if falling else 3,
        starts={"reference": 1.0, "fallen": 0.0, "recovery": 0.0, "commanded": 1.0, "adaptive": 0.5},
        tracking={"follow": falling, "lost": 0.0},
    )
    assert isinstance(env, HumanoidVectorEnv)
    env.reset(seed=0)
    ended = 0
    for _ in range(30):
        _, _, terminated, truncated, _ = env.step(np.zeros((20, 31), np.float32))
        ended += int(terminated.sum() if falling else truncated.sum())
    assert ended > 20
    falls = env._starts.state_dict()["falls"]
    assert (falls == 1.0).all() if falling else falls.mean() < 0.8
    env.reset(seed=0)  # a new seed knows of no falls
    assert (env._starts.state_dict()["falls"] == 1.0).all()
