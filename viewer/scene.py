"""The scene on the page: made once, and moved with every frame. The browser draws it."""

from collections.abc import Sequence

import mujoco
import numpy as np
import viser

from murmillo.envs.markers import Marker
from murmillo.viewer.session import Frame
from murmillo.viewer.shapes import glb, shapes_of

_WORLD = "/world"
_CAMERA, _LOOK_AT = (2.6, -2.9, 1.7), (0.0, 0.0, 0.9)
"""[m] As the page opens, from the place that is followed."""
_SAND, _LINES = (150, 129, 99), (117, 97, 71)
_FOLLOW = 0.15
"""Part of its way to the character that the followed place goes in a frame."""
_LEAP = 3.0
"""[m] Farther than this the followed place leaps."""


class Scene:
    """The character, the props and the markers of one session, the same in all browsers.

    The camera is each browser's own. To follow the character the world is moved beneath it, so that an orbit goes on as
    it is, and the light, whose shadows reach some metres only, stays with the character.

    Attributes:
        follow: whether the character stays in the middle.
    """

    def __init__(self, server: viser.ViserServer, model: mujoco.MjModel) -> None:
        """`model` has the visual geoms, and the bodies of the frames to come in their order."""
        self.follow = True
        self._server = server
        self._focus = np.zeros(2)
        scene = server.scene
        scene.configure_environment_map("park", environment_intensity=0.5)
        self._world = scene.add_frame(_WORLD, show_axes=False)
        shapes = shapes_of(model)
        ground = [shape for shape in shapes if shape.body == 0]
        lowest = min((shape.mesh.bounds[0][2] for shape in ground), default=0.0)
        if ground:
            scene.add_glb(f"{_WORLD}/ground", glb(ground))
        scene.add_grid(
            f"{_WORLD}/floor",
            position=(0.0, 0.0, lowest),  # beyond the rim of uneven ground
            infinite_grid=True,
            fade_distance=45.0,
            cell_size=1.0,
            section_size=5.0,
            cell_color=_LINES,
            section_color=_LINES,
            plane_color=_SAND,
            plane_opacity=1.0,
            shadow_opacity=0.35,
        )
        self._bodies = [
            scene.add_glb(f"{_WORLD}/{model.body(i).name}", glb([shape for shape in shapes if shape.body == i]))
            for i in range(1, model.nbody)
        ]
        self._markers = _Markers(scene)
        server.initial_camera.position = _CAMERA
        server.initial_camera.look_at = _LOOK_AT
        server.initial_camera.fov = np.radians(40.0)

    def show(self, frame: Frame) -> None:
        """Put everything where the frame has it, for all browsers; does not wait for any."""
        self._move_focus(frame.pose_w[0, :2])
        with self._server.atomic():
            self._world.position = (-self._focus[0], -self._focus[1], 0.0)
            for handle, pose in zip(self._bodies, frame.pose_w, strict=True):
                handle.position, handle.wxyz = pose[:3], pose[3:]
            self._markers.show(frame.markers)

    def on_ground(self, event: viser.SceneClickEvent) -> tuple[float, float] | None:
        """The place on the ground that a click points at [m], world axes; None in the sky."""
        origin, ray = np.array(event.ray_origin), np.array(event.ray_direction)
        if ray[2] >= 0.0:
            return None
        x, y = (origin - origin[2] / ray[2] * ray)[:2] + self._focus
        return float(x), float(y)

    def _move_focus(self, place: np.ndarray) -> None:
        if self.follow:
            far = np.linalg.norm(place - self._focus) > _LEAP
            self._focus = self._focus + (1.0 if far else _FOLLOW) * (place - self._focus)


class _Ball:
    """A marker without a direction."""

    def __init__(self, scene: viser.SceneApi, name: str, marker: Marker) -> None:
        *_, opacity = marker.rgba
        self._handle = scene.add_icosphere(name, marker.size, marker.rgba[:3], opacity=opacity, cast_shadow=False)
        self.remove = self._handle.remove

    def place(self, marker: Marker) -> None:
        self._handle.position = np.asarray(marker.pos_w)


class _Arrow:
    """A marker with a direction."""

    def __init__(self, scene: viser.SceneApi, name: str, marker: Marker) -> None:
        thickness = 0.025 * marker.size
        self._handle = scene.add_arrows(
            name,
            _ends(marker),
            marker.rgba[:3],
            shaft_radius=thickness,
            head_radius=2.5 * thickness,
            head_length=0.25 * marker.size,
        )
        self.remove = self._handle.remove

    def place(self, marker: Marker) -> None:
        self._handle.points = _ends(marker)


class _Markers:
    """The balls and arrows that are shown now; one is made anew only where it takes the place of another kind."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: list[tuple[tuple, _Ball | _Arrow]] = []

    def show(self, markers: Sequence[Marker]) -> None:
        while len(self._shown) > len(markers):
            self._shown.pop()[1].remove()
        for number, marker in enumerate(markers):
            make = _Ball if marker.direction_w is None else _Arrow
            look = (make, marker.size, marker.rgba)
            if number == len(self._shown) or self._shown[number][0] != look:
                made = make(self._scene, f"{_WORLD}/markers/{number}", marker)  # takes the place of one of that name
                self._shown[number : number + 1] = [(look, made)]
            self._shown[number][1].place(marker)


def _ends(marker: Marker) -> np.ndarray:
    """Where an arrow begins and where it ends [1, 2, 3] [m]."""
    direction = np.asarray(marker.direction_w, dtype=np.float64)
    pos = np.asarray(marker.pos_w, dtype=np.float64)
    return np.stack((pos, pos + marker.size * direction / max(float(np.linalg.norm(direction)), 1e-9)))[None]
