"""Contact sheets: a clip at a glance, from three sides. Without a screen, set MUJOCO_GL=egl."""

from pathlib import Path

import imageio.v3 as iio
import mujoco
import numpy as np

from murmillo.envs.character import Character
from murmillo.envs.motion.clip import Clip

CAMERAS = ("track", "side", "front")


def draw(clip: Clip, character: Character, file: Path, columns: int = 12, size: int = 260) -> None:
    """Write a PNG: a row a camera, `columns` moments of the clip evenly spaced, each `size` pixels square."""
    model = character.render_model((size, size))
    data = mujoco.MjData(model)
    rows: list[list[np.ndarray]] = [[] for _ in CAMERAS]
    with mujoco.Renderer(model, size, size) as renderer:
        for frame in np.linspace(0, clip.frames - 1, columns).round().astype(int):
            data.qpos = clip.qpos[frame]
            mujoco.mj_forward(model, data)
            for row, camera in zip(rows, CAMERAS, strict=True):
                renderer.update_scene(data, camera)
                row.append(renderer.render().copy())
    file.parent.mkdir(parents=True, exist_ok=True)
    iio.imwrite(file, np.vstack([np.hstack(row) for row in rows]))
