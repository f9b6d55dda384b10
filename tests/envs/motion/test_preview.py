"""Contact sheets and films of a clip, small ones."""

from pathlib import Path

import imageio.v2 as imageio
import imageio_ffmpeg
import pytest

from murmillo.envs.character import load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.editing import trim
from murmillo.envs.motion.preview import contact_sheet, film

CHARACTER = load_character("sword_shield")


@pytest.fixture(scope="module")
def clip() -> Clip:
    clips = {clip.name: clip for clip in load_clips("builtin", CHARACTER)}
    return trim(clips["kick"], 1.0, 1.1)


def drawn(draw):
    """What `draw` returns; skips where nothing can be drawn."""
    try:
        return draw()
    except SuiteError as error:
        if "no OpenGL" in str(error):
            pytest.skip(str(error))
        raise


def test_a_sheet_has_a_row_a_camera(tmp_path: Path, clip: Clip) -> None:
    file = drawn(lambda: contact_sheet(clip, CHARACTER, tmp_path / "new/kick.png", columns=2, size=48))
    picture = imageio.imread(file)
    assert picture.shape == (3 * 48, 2 * 48, 3)
    first, second, third = (picture[48 * row : 48 * (row + 1), :48] for row in range(3))
    assert (first != second).any()
    assert (second != third).any()


def test_a_film_has_a_picture_a_frame(tmp_path: Path, clip: Clip) -> None:
    file = drawn(lambda: film(clip, CHARACTER, tmp_path / "kick.mp4", size=(64, 48)))
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(file))
    assert (frames, seconds) == (clip.frames, pytest.approx(clip.frames / clip.fps, abs=0.02))
    assert [path.name for path in tmp_path.iterdir()] == ["kick.mp4"]


def test_nothing_is_left_of_what_cannot_be_drawn(tmp_path: Path, clip: Clip) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(SuiteError, match="camera=moon: no such camera; there are: track, side, front"):
        film(clip, CHARACTER, tmp_path / "kick.mp4", camera="moon")
    with pytest.raises(SuiteError, match="cannot be written"):
        contact_sheet(clip, CHARACTER, tmp_path / "file/kick.png", columns=1, size=16)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
