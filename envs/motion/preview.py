"""Pictures of a clip: contact sheets and films. Without a screen, set MUJOCO_GL to egl or osmesa."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import mujoco
import numpy as np
from numpy.typing import NDArray

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion.clip import Clip

CAMERAS = ("track", "side", "front")


def contact_sheet(clip: Clip, character: Character, file: Path, columns: int = 12, size: int = 260) -> Path:
    """Write a PNG and return its path: a row a camera, `columns` moments of the clip evenly spaced, from left to right.

    The character fills the pictures, as large in all of a row; sword and shield are never cut off.

    Args:
        size: width and height of each picture in it [pixels].

    Raises:
        SuiteError: nothing can be drawn here, or the file cannot be written.
    """
    moments = np.linspace(0, clip.frames - 1, columns).round().astype(int)
    seen = list(_draw(clip.qpos[moments], character, CAMERAS, (size, size), filling=True))
    with _whole(file) as beside:
        imageio.imwrite(beside, np.vstack([np.hstack(row) for row in zip(*seen, strict=True)]))
    return file


def film(
    clip: Clip, character: Character, file: Path, camera: str = "track", size: tuple[int, int] = (640, 480)
) -> Path:
    """Write an mp4 of the clip at its own rate and return its path; `size` is width and height [pixels].

    Raises:
        SuiteError: nothing can be drawn here, there is no such camera, or the file cannot be written.
    """
    with _whole(file) as beside:
        writer: Any = imageio.get_writer(beside, fps=clip.fps, macro_block_size=1)
        with writer:
            for (frame,) in _draw(clip.qpos, character, (camera,), size):
                writer.append_data(frame)
    return file


def _draw(
    poses: NDArray[np.float64],
    character: Character,
    cameras: Sequence[str],
    size: tuple[int, int],
    filling: bool = False,
) -> Iterator[list[NDArray[np.uint8]]]:
    """Of each of the poses [F, nq] the pictures [height, width, 3] that these cameras take.

    `filling` opens each camera just so far that the character is whole in all of the poses.
    """
    model = character.render_model(offscreen=size)
    known = [model.camera(i).name for i in range(model.ncam)]
    for camera in cameras:
        if camera not in known:
            raise SuiteError(f"camera={camera}: no such camera; there are: {', '.join(known)}")
    data = mujoco.MjData(model)
    if filling:
        for camera in cameras:
            model.camera(camera).fovy = _view(model, data, poses, camera, size[0] / size[1])
    try:
        renderer = mujoco.Renderer(model, size[1], size[0])
    except Exception as error:
        raise SuiteError(
            f"rendering: no OpenGL context ({error}); install libegl1 or libosmesa6 and set MUJOCO_GL=egl or osmesa"
        ) from error
    with renderer:
        for pose in poses:
            data.qpos = pose
            mujoco.mj_forward(model, data)
            pictures = []
            for camera in cameras:
                renderer.update_scene(data, camera)
                pictures.append(renderer.render().copy())
            yield pictures


def _view(model: mujoco.MjModel, data: mujoco.MjData, poses: NDArray[np.float64], camera: str, aspect: float) -> float:
    """The vertical field of view [degrees] in which the character is whole in all of the poses, with a small margin."""
    geoms = np.flatnonzero(model.geom_bodyid)  # the floor is the world's
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(8, 3)
    corners = model.geom_aabb[geoms, None, :3] + signs * model.geom_aabb[geoms, None, 3:]
    tangent = 0.0
    for pose in poses:
        data.qpos = pose
        mujoco.mj_forward(model, data)
        turned = corners @ data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1)
        seen = data.camera(camera)
        points = (turned + data.geom_xpos[geoms, None] - seen.xpos) @ seen.xmat.reshape(3, 3)  # it looks along -z
        tangent = max(tangent, float((np.abs(points[..., :2]) / [aspect, 1.0] / -points[..., 2:]).max()))
    return float(np.degrees(2.0 * np.arctan(1.05 * tangent)))


@contextmanager
def _whole(file: Path) -> Iterator[Path]:
    """A path beside `file` to write to, which takes its name at the end, or is gone where that was not reached."""
    beside = file.with_name(f".{file.stem}.part{file.suffix}")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        beside.replace(file)
    except OSError as error:
        raise SuiteError(f"{file}: cannot be written ({error.strerror or error}); choose another folder") from None
    finally:
        if beside.parent.is_dir():
            beside.unlink(missing_ok=True)
