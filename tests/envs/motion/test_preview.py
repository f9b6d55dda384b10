"""Contact sheets and films of a clip, small ones."""

from pathlib import Path

import imageio.v2 as imageio
import imageio_ffmpeg
import mujoco
import numpy as np
import pytest

from murmillo.envs.character import load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion import Clip, load_clips
from murmillo.envs.motion.editing import trim
from murmillo.envs.motion.preview import CAMERAS, _view, contact_sheet, film

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


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_character_fills_a_sheet_and_is_whole(camera: str) -> None:
    """Its pixels reach across most of the picture, and none is at the edge."""
    kick = next(clip for clip in load_clips("builtin", CHARACTER) if clip.name == "kick")
    model = CHARACTER.render_model(offscreen=(200, 200))
    data = mujoco.MjData(model)
    poses = kick.qpos[::10]
    model.camera(camera).fovy = _view(model, data, poses, camera, aspect=1.0)
    try:
        renderer = mujoco.Renderer(model, 200, 200)
    except Exception as error:
        pytest.skip(f"no OpenGL draws on this machine: {error}")
    with renderer:
        renderer.enable_segmentation_rendering()
        seen = np.zeros((200, 200), dtype=bool)
        for pose in poses:
            data.qpos = pose
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, camera)
            geom = renderer.render()[..., 0]
            seen |= (geom >= 0) & (model.geom_bodyid[geom] > 0)
    assert not seen[[0, -1]].any()
    assert not seen[:, [0, -1]].any()
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    assert max(np.abs(rows - 99.5).max(), np.abs(columns - 99.5).max()) > 0.85 * 100
