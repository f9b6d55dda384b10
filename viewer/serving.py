"""The server that puts a session on a page, for as many browsers as there are."""

import contextlib
import io
import threading
from collections.abc import Callable

import viser

from murmillo.viewer.loop import Loop
from murmillo.viewer.page import Page
from murmillo.viewer.scene import Scene
from murmillo.viewer.session import Frame, Session


def serve(
    session: Session, title: str, host: str, port: int, stop: threading.Event, ready: Callable[[str], object]
) -> None:
    """Play until `stop` is set, in this thread; the server has threads of its own and is gone afterwards.

    A browser that is slow misses frames: for each there is a queue in which a newer pose takes an older one's place.

    Args:
        session: what is played.
        title: at the head of the page's controls.
        host: address that is listened at.
        port: which must be free; otherwise the next free one is taken.
        stop: ends it.
        ready: is called with the page's address when it can be opened.
    """
    with _quiet():
        server = viser.ViserServer(host, port, verbose=False)
    try:
        scene = Scene(server, session.env.scene.render_model())

        def show(frame: Frame) -> None:
            scene.show(frame)
            page.show(frame)

        loop = Loop(session, show)
        page = Page(server, session, loop, scene, title)
        ready(f"http://{host}:{server.get_port()}")
        loop.run(stop)
    finally:
        with _quiet():
            server.stop()


def _quiet() -> contextlib.redirect_stdout[io.StringIO]:
    """Viser prints a banner when it begins and a word when it ends, which are not the user's concern."""
    return contextlib.redirect_stdout(io.StringIO())
