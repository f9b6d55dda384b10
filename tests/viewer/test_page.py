"""The page is served, shows the scene and the controls that a session has room for, and is gone afterwards."""

import socket
import threading
import urllib.request
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from murmillo.envs.markers import Marker
from murmillo.viewer.session import Frame, Session, Status

pytest.importorskip("viser", reason="the extra play is not installed")

import viser  # after the extra was looked for

from murmillo.viewer.loop import Loop
from murmillo.viewer.page import KEYS, Page, status_text
from murmillo.viewer.scene import Scene
from murmillo.viewer.serving import serve

Play = Callable[..., Session]


@pytest.fixture
def port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.fixture
def server(port: int) -> Any:
    server = viser.ViserServer("127.0.0.1", port, verbose=False)
    yield server
    server.stop()


def test_the_page_is_served_to_several_and_the_port_is_free_afterwards(play: Play, port: int) -> None:
    session, stop, ready, answers = play("case"), threading.Event(), threading.Event(), []
    address: list[str] = []

    def visit() -> None:
        if ready.wait(timeout=60.0):
            for _ in range(2):
                with urllib.request.urlopen(address[0], timeout=60.0) as answer:
                    answers.append((answer.status, b"<html" in answer.read()[:1000].lower()))
        stop.set()

    visitor = threading.Thread(target=visit)
    visitor.start()
    serve(session, "tested", "127.0.0.1", port, stop, lambda url: (address.append(url), ready.set()))
    visitor.join()
    assert address == [f"http://127.0.0.1:{port}"]
    assert answers == [(200, True)] * 2
    socket.create_server(("127.0.0.1", port)).close()


def test_the_scene_moves_with_the_frames_and_stays_in_the_middle(server: viser.ViserServer, play: Play) -> None:
    session = play("ase", "Strike")
    scene = Scene(server, session.env.scene.render_model())
    frame = session.look()
    scene.show(frame)
    bodies = [*session.env.character.bodies, "target"]
    for name, pose in zip(bodies, frame.pose_w, strict=True):
        handle = server.scene.get_handle_by_name(f"/world/{name}")
        assert handle is not None
        np.testing.assert_allclose([*handle.position, *handle.wxyz], pose)
    far = Frame(frame.pose_w + np.array([20.0, 30.0, *[0.0] * 5]), (), frame.status)
    scene.show(far)
    world = server.scene.get_handle_by_name("/world")
    assert world is not None
    np.testing.assert_allclose(world.position[:2] + far.pose_w[0, :2], 0.0, atol=1e-9)
    scene.follow = False
    scene.show(frame)
    np.testing.assert_allclose(world.position[:2] + far.pose_w[0, :2], 0.0, atol=1e-9)


def test_markers_come_and_go(server: viser.ViserServer, play: Play) -> None:
    session = play("ase")
    scene = Scene(server, session.env.scene.render_model())
    frame = session.look()
    ball, arrow = Marker((1.0, 2.0, 3.0)), Marker((0.0, 0.0, 1.0), (0.0, 2.0, 0.0), size=0.5)

    def show(*markers: Marker) -> list[Any]:
        scene.show(Frame(frame.pose_w, markers, frame.status))
        return [server.scene.get_handle_by_name(f"/world/markers/{i}") for i in range(2)]

    first, second = show(ball, arrow)
    assert first.position.tolist() == [1.0, 2.0, 3.0]
    assert second.points.tolist() == [[[0.0, 0.0, 1.0], [0.0, 0.5, 1.0]]]
    first, second = show(arrow)
    assert first.points.shape == (1, 2, 3)
    assert second is None
    assert show() == [None, None]


def test_a_click_on_the_ground_is_a_place_in_the_world(server: viser.ViserServer, play: Play) -> None:
    session = play("ase")
    scene = Scene(server, session.env.scene.render_model())
    frame = session.look()
    scene.show(Frame(frame.pose_w + np.array([20.0, 30.0, *[0.0] * 5]), (), frame.status))
    x, y = frame.pose_w[0, :2] + (20.0, 30.0)

    def click(origin: tuple, ray: tuple) -> tuple[float, float] | None:
        event: Any = SimpleNamespace(ray_origin=origin, ray_direction=ray)
        return scene.on_ground(event)

    assert click((0.0, 0.0, 2.0), (0.5, 0.0, -1.0)) == pytest.approx((x + 1.0, y))
    assert click((0.0, 0.0, 2.0), (0.5, 0.0, 0.1)) is None


@pytest.mark.parametrize(
    ("session", "folders", "keys"),
    [
        (("ase",), {"Time", "Latent", "Push for 0.2 s"}, {"space", "N", "R", "F"}),
        (("case",), {"Time", "Skill", "Latent", "Push for 0.2 s"}, {"space", "N", "R", "F", "pageup", "pagedown"}),
        (("ase", "Steering"), {"Time", "Goal", "Push for 0.2 s"}, {"space", "N", "R", "F", "J", "L", "I", "K"}),
        (("ase", "Strike"), {"Time", "Goal", "Push for 0.2 s"}, {"space", "N", "R", "F"}),
    ],
)
def test_controls_are_those_that_the_session_has_room_for(
    server: viser.ViserServer, play: Play, session: tuple, folders: set, keys: set, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: dict[str, set] = {"folders": set(), "keys": set()}
    add_folder, add_command = server.gui.add_folder, server.gui.add_command
    monkeypatch.setattr(server.gui, "add_folder", lambda name: (shown["folders"].add(name), add_folder(name))[1])
    monkeypatch.setattr(
        server.gui, "add_command", lambda name, hotkey: (shown["keys"].add(hotkey), add_command(name, hotkey=hotkey))[1]
    )
    played = play(*session)
    loop = Loop(played, lambda frame: None)
    page = Page(server, played, loop, Scene(server, played.env.scene.render_model()), "tested")
    page.show(played.look())
    assert shown == {"folders": folders, "keys": keys}
    assert keys <= KEYS.keys()


def test_an_adaptation_has_a_slider_that_begins_where_it_is(
    server: viser.ViserServer, play: Play, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, told, begun = play("ase"), [], {}
    adapted: Any = SimpleNamespace(adapters=1, alpha=0.25, blend=told.append)
    session.adapted = adapted
    add_slider = server.gui.add_slider

    def slider(name: str, low: float, high: float, step: float, value: float, **others: Any) -> Any:
        begun[name] = (low, high, value)
        return add_slider(name, low, high, step, value, **others)

    monkeypatch.setattr(server.gui, "add_slider", slider)
    Page(server, session, Loop(session, lambda frame: None), Scene(server, session.env.scene.render_model()), "tested")
    assert begun["Alpha"] == (0.0, 1.0, 0.25)
    session.blend(0.75)
    assert told == [0.75]
    assert play("ase").adapted is None


def test_the_status_has_what_there_is() -> None:
    status = Status(2.0, "kick", 0.881, 1.25, 1, 0.5, {"position": 0.25})
    frame = Frame(np.zeros((17, 7)), (), status)
    text = status_text(frame, pace=1.0, paused=False)
    for part in ("**kick**", "2.0 s, 1 fall ", "0.88 m, 1.2 m/s", "clips: 0.50", "position reward 0.25", "100%"):
        assert part in text
    assert "cannot keep up: 60%" in status_text(frame, pace=0.6, paused=False)
    assert "stands still" in status_text(frame, pace=0.6, paused=True)
    assert "clips" not in status_text(Frame(frame.pose_w, (), Status(0.0, None, 0.0, 0.0, 0, None, {})), 1.0, False)
