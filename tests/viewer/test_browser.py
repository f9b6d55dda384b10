"""Pages as a browser has them: each kind of run is opened, and its controls do what they say."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import torch

from murmillo.viewer.session import Frame, Session

pytest.importorskip("viser", reason="the extra play is not installed")

import viser  # after the extra was looked for

from murmillo.viewer.loop import Loop
from murmillo.viewer.page import Page
from murmillo.viewer.scene import Scene
from murmillo.viewer.serving import serve
from tests.viewer.browser import Browser, wait_for

Play = Callable[..., Session]


@contextmanager
def opened(session: Session) -> Iterator[Browser]:
    """A browser at the page of this session, which is played meanwhile."""
    stop, ready, address = threading.Event(), threading.Event(), []
    arguments = (session, "tested", "127.0.0.1", 8080, stop, lambda url: (address.append(url), ready.set()))
    player = threading.Thread(target=serve, args=arguments)
    player.start()
    try:
        assert ready.wait(timeout=60.0)
        with Browser(address[0]) as browser:
            yield browser
            assert player.is_alive()  # no control has ended it
    finally:
        stop.set()
        player.join()


def seconds(session: Session) -> float:
    return session.look().status.seconds


def test_an_agent_is_steered_by_its_latents(play: Play) -> None:
    session = play("ase")
    latents = session.latents
    assert latents is not None
    with opened(session) as browser:
        browser.set("Draw a new one", True)
        wait_for(lambda: latents.chosen is not None)
        browser.set("Keep this one (up to 8)", True)
        wait_for(lambda: "favourite 1" in browser.options("Follow"))
        wait_for(lambda: browser.shows("Follow") == "favourite 1")
        browser.set("Draw a new one", True)
        wait_for(lambda: not torch.equal(latents.chosen, latents.named["favourite 1"]))  # type: ignore[arg-type] # one is
        browser.set("Keep this one (up to 8)", True)
        wait_for(lambda: "favourite 2" in browser.options("Blend with"))
        browser.set("Blend with", "favourite 1")
        browser.set("Part", 1.0)
        wait_for(lambda: torch.allclose(latents.chosen, latents.named["favourite 1"], atol=1e-5))  # type: ignore[arg-type]
        browser.set("Leave it to chance", True)
        wait_for(lambda: latents.chosen is None)


def test_time_and_falls(play: Play) -> None:
    session = play("ase")
    with opened(session) as browser:
        wait_for(lambda: seconds(session) > 0.2)
        browser.set("Stand still", True)
        wait_for(lambda: "stands still" in browser.status)
        browser.key("R")
        wait_for(lambda: seconds(session) == 0.0)
        browser.key("N")
        browser.set("One step", True)
        wait_for(lambda: seconds(session) == pytest.approx(2 / 30))
        browser.key("space")
        wait_for(lambda: browser.shows("Stand still") is False)
        wait_for(lambda: seconds(session) > 0.2)
        browser.set("Stay down after a fall", True)
        wait_for(lambda: session.stay_down)
        browser.set("Newtons", 2000)
        browser.set("Towards", "left")
        wait_for(lambda: session._push_left > 0)
        force = session._push_w
        assert float(force.norm()) == pytest.approx(2000.0)


@pytest.mark.parametrize("name", ["scratch", "ase"])
def test_a_policy_is_steered_by_its_goal(play: Play, name: str) -> None:
    session = play(name, "Steering")
    goals = session.goals
    with opened(session) as browser:
        browser.set("Move towards (°)", -45)  # one of the two is another than what the slider shows already
        browser.set("Move towards (°)", 90)
        wait_for(lambda: goals.now("direction_w").tolist() == pytest.approx([0.0, 1.0]))
        browser.key("J")
        wait_for(lambda: goals.now("direction_w")[0].item() == pytest.approx(math.cos(math.radians(105.0))))
        browser.key("L")
        wait_for(lambda: goals.now("direction_w").tolist() == pytest.approx([0.0, 1.0]))
        browser.set("Face (°)", 0)
        browser.set("Face (°)", 180)
        wait_for(lambda: goals.now("facing_w").tolist() == pytest.approx([-1.0, 0.0]))
        browser.set("Speed (m/s)", 6.9)
        wait_for(lambda: goals.now("speed").item() == pytest.approx(6.9))
        browser.key("I")
        wait_for(lambda: goals.now("speed").item() == 7.0)  # no more than the slider has
        wait_for(lambda: browser.shows("Speed (m/s)") == 7.0)
        browser.key("K")
        wait_for(lambda: goals.now("speed").item() == 6.5)
        browser.click((0.0, 0.0, 5.0), (-1.0, 0.0, -0.01))  # far off, the way of -x
        wait_for(lambda: goals.now("direction_w")[0].item() < -0.99)
        browser.set("Draw a new goal", True)
        wait_for(lambda: not goals.chosen)


def test_the_page_does_not_move_a_slider_back_while_it_is_being_moved(play: Play) -> None:
    session, shown, late = play("ase", "Steering"), [], []
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    scene = Scene(server, session.env.scene.render_model())

    def show(frame: Frame) -> None:
        if late:
            browser.set("Face (°)", late.pop())  # it comes between a command and what the page shows of it
            wait_for(lambda: not loop._commands.empty())
        page.show(frame)
        shown.append(page._sliders["facing_w"].value)

    loop = Loop(session, show)
    page = Page(server, session, loop, scene, "tested")
    loop.pause(True)
    session.goals.face(math.radians(90))
    try:
        loop.do(lambda: None)
        loop.tick()
        assert shown == [90.0]
        with Browser(f"http://127.0.0.1:{server.get_port()}") as browser:
            browser.set("Face (°)", 0)
            wait_for(lambda: not loop._commands.empty())
            late.append(180)
            loop.tick()
            loop.tick()
    finally:
        server.stop()
    assert shown == [90.0, 180.0, 180.0]
    assert session.goals.now("facing_w").tolist() == pytest.approx([-1.0, 0.0])


def test_a_policy_of_styles_offers_those_that_it_has_learned(play: Play) -> None:
    session = play("calm", "Direction", styles=("run_forward", "walk_forward"))
    with opened(session) as browser:
        assert browser.options("Commanded") == ["by chance", "run_forward", "walk_forward"]
        browser.set("Commanded", "walk_forward")
        wait_for(lambda: session.look().status.skill == "walk_forward")
        browser.key("pageup")
        wait_for(lambda: session.look().status.skill == "run_forward")
        wait_for(lambda: browser.shows("Commanded") == "run_forward")
        browser.key("pagedown")
        wait_for(lambda: session.look().status.skill == "walk_forward")


@pytest.mark.parametrize("task", ["Strike", "Block", "Recovery", "PathFollow", "Location"])
def test_every_kind_of_goal_can_be_drawn_anew(play: Play, task: str) -> None:
    session = play("scratch", task)

    def drawn() -> dict[str, torch.Tensor]:
        kept = {name: value for name, value in session.env.task.state_dict().items() if torch.is_tensor(value)}
        return kept | {"props": session.env.state.prop_qpos.clone()}

    before = drawn()
    session.goals.redraw()
    assert any(not torch.equal(before[name], value) for name, value in drawn().items())
    session.step()
