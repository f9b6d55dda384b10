"""Windows gathered from frames that were made once are those of the poses, and draws of them those of the clips."""

import pytest
import torch

from murmillo.envs.features import make_features
from murmillo.envs.motion import MotionLibrary, grid
from murmillo.envs.motion.demonstrations import Demonstrations
from murmillo.envs.motion.grid import PHASES, FrameGrid
from murmillo.envs.motion.velocities import clip_velocities

EIGHTH = 1 / 240


def random() -> torch.Generator:
    return torch.Generator().manual_seed(3)


@pytest.fixture(scope="module", params=["character", "links"])
def library(request, character, make_clip) -> MotionLibrary:
    clips = [
        make_clip("slow", frames=31, seed=1),
        make_clip("odd", frames=40, seed=2, fps=29.857, masked=("shield",)),
        make_clip("fast", frames=50, seed=3, fps=120.0),
    ]
    return MotionLibrary(clips, character, features=make_features(request.param, character))


def test_windows_are_those_of_the_middle_of_the_eighth(library) -> None:
    clip, time = library.sample(500, random())
    clip = torch.cat((clip, torch.arange(3), torch.arange(3)))
    time = torch.cat((time, library.duration, torch.zeros(3)))  # both ends of each clip
    middle = ((time / EIGHTH - 1e-9).floor().clamp_min(0) + 0.5) * EIGHTH
    middle[-3:] = 0.5 * EIGHTH
    expected = library.window(clip, middle, 6)
    torch.testing.assert_close(FrameGrid(library).window(clip, time, 6), expected, atol=2e-5, rtol=0)
    assert (time < 5 / 30).sum() > 50  # of which the first frame is repeated


def test_draws_are_distributed_like_the_clip(make_clip, character) -> None:
    """A root that rises by 1 m/s for a second and by 3 m/s for another: its height says when, its speed which."""
    qpos, time = character.default_qpos.repeat(61, 1), torch.arange(61) / 30
    qpos[:, 2] = 1 + time + 2 * (time - 1).clamp_min(0)
    library = MotionLibrary([make_clip("rise", qpos=qpos.numpy())], character)
    demonstrations, n = Demonstrations(library, character, 1, 31), 20_000
    newest = demonstrations(n, random())["window"][:, -1]
    exact = library.window(*library.sample(n, random()), 1)[:, -1]
    height, speed = newest[:, 0] - exact[:, 0], newest[:, 9]
    assert height.abs().max() <= 3 * 0.5 * EIGHTH + 1e-5
    assert abs(height.mean()) < 5e-5  # an eighth's beginning instead of its middle would be 4e-3 too low
    assert height.std() > 1e-3  # and they are not the exact ones
    velocity = clip_velocities(character, qpos, 30.0)[:-1, 2]
    for metres_per_second in (1.0, 3.0):
        share = ((velocity - metres_per_second).abs() < 0.1).double().mean().item()
        assert ((speed - metres_per_second).abs() < 0.1).double().mean().item() == pytest.approx(share, abs=0.01)


def test_a_part_of_a_draw_is_those_rows_of_it(library) -> None:
    demonstrations = Demonstrations(library, library.character, 4, 31)
    whole, rows = demonstrations(40, random()), torch.tensor([3, 17, 18, 39])
    part = demonstrations(40, random(), rows=rows)
    assert whole.keys() == part.keys() == {"window", "skill", "mask"}
    for name, value in part.items():
        torch.testing.assert_close(value, whole[name][rows], atol=1e-6, rtol=0)


def test_clips_that_take_too_much_room_are_reckoned_at_each_draw(library, monkeypatch) -> None:
    seconds = library.duration.sum().item()
    taken = 4 * library.features.frame_dim * PHASES * 30 * seconds
    monkeypatch.setattr(grid, "MOST_BYTES", 0.9 * taken)
    assert FrameGrid.of(library) is None
    drawn = Demonstrations(library, library.character, 4, 31)(40, random())["window"]
    assert torch.equal(drawn, library.window(*library.sample(40, random()), 4))
    monkeypatch.setattr(grid, "MOST_BYTES", 1.1 * taken)
    assert FrameGrid.of(library) is not None
