"""Pictures of one world."""

import threading
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from murmillo.envs._opengl import HEADLESS
from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.markers import Marker, draw_markers
from murmillo.envs.scene import Scene


class FrameRenderer:
    """Off-screen frames, with the visual geoms that the simulated model leaves out."""

    def __init__(self, scene: Scene | Character, width: int = 640, height: int = 480, camera: str = "track") -> None:
        """`camera` is one of the MJCF's: "track", "side" or "front"; all follow the character.

        Raises:
            SuiteError: no OpenGL context can be had, or there is no such camera.
        """
        self._model = scene.render_model(offscreen=(width, height))
        self._data = mujoco.MjData(self._model)
        cameras = [self._model.camera(i).name for i in range(self._model.ncam)]
        if camera not in cameras:
            raise SuiteError(f"camera={camera}: no such camera; there are: {', '.join(cameras)}")
        self._camera = camera
        try:
            self._renderer = mujoco.Renderer(self._model, height, width)
        except Exception as error:
            raise SuiteError(
                f"rendering: no OpenGL context ({error}); install libegl1 or libosmesa6 and set MUJOCO_GL=egl or "
                "osmesa before mujoco is imported"
            ) from error

    def frame(self, qpos: np.ndarray, markers: Sequence[Marker] = ()) -> np.ndarray:
        """RGB frame [height, width, 3] uint8 of the pose qpos [nq], props and all."""
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._renderer.update_scene(self._data, self._camera)
        draw_markers(self._renderer.scene, markers)
        return self._renderer.render()

    def draw(self, poses: np.ndarray, markers: Sequence[Sequence[Marker]]) -> tuple[np.ndarray, ...]:
        """Frames of the poses [n, nq], each with its markers."""
        return tuple(self.frame(pose, shown) for pose, shown in zip(poses, markers, strict=True))

    def close(self) -> None:
        self._renderer.close()


class Window:
    """A live window on a screen."""

    def __init__(self, scene: Scene | Character) -> None:
        """Raises SuiteError where there is no screen."""
        if HEADLESS:  # MuJoCo's viewer would end the process
            raise SuiteError("render_mode=human: there is no screen (DISPLAY is not set); use rgb_array")
        from mujoco import viewer  # needs a screen's libraries

        self._model = scene.render_model()
        self._data = mujoco.MjData(self._model)
        others = set(threading.enumerate())
        self._viewer: Any = viewer.launch_passive(self._model, self._data)
        self._threads = set(threading.enumerate()) - others

    def draw(self, poses: np.ndarray, markers: Sequence[Sequence[Marker]]) -> None:
        """Show the first of the poses [n, nq] with its markers."""
        with self._viewer.lock():
            self._data.qpos[:] = poses[0]
            mujoco.mj_forward(self._model, self._data)
            self._viewer.user_scn.ngeom = 0
            draw_markers(self._viewer.user_scn, markers[0])
        self._viewer.sync()

    def close(self) -> None:
        self._viewer.close()
        for thread in self._threads:  # it draws until it has seen the end; the interpreter must outlive it
            thread.join(timeout=5.0)


def make_screen(scene: Scene, human: bool, width: int, height: int, camera: str) -> FrameRenderer | Window:
    """A window for a human, else what draws frames of this size through this camera.

    Raises:
        SuiteError: there is no screen, no OpenGL context, or no such camera.
    """
    return Window(scene) if human else FrameRenderer(scene, width, height, camera)
