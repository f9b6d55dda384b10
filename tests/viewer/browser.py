"""A browser without a screen: it reads what the page's server sends, and answers as viser's own page does."""

import threading
import time
from collections.abc import Callable
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

_CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (2.0, 0.0, 1.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 48,
    "image_width": 64,
    "look_at": (0.0, 0.0, 1.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class Browser:
    """One tab; a context manager. `controls` has what the page shows, by uuid and as the server describes it."""

    def __init__(self, address: str) -> None:
        """`address` is the page's, http://…; the tab counts as open once it has told where its camera is."""
        self.controls: dict[str, dict[str, Any]] = {}
        version = f"viser-v{viser.__version__}"
        self._socket = connect(address.replace("http", "ws"), subprotocols=[version], max_size=None)  # type: ignore[list-item] # a str
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        self._send("ViewerCameraMessage", **_CAMERA)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
        self._reader.join()

    def set(self, label: str, value: Any) -> None:
        """Move the control of this label; a button is pressed by any value."""
        self._send("GuiUpdateMessage", uuid=self._named(label)["uuid"], updates={"value": value})

    def key(self, hotkey: str) -> None:
        """Press a key."""
        self._send("CommandTriggerMessage", uuid=self._where(lambda shown: shown.get("hotkey") == hotkey)["uuid"])

    def click(self, origin: tuple[float, float, float], ray: tuple[float, float, float]) -> None:
        """Click at what lies along a ray of the scene."""
        fields = {"screen_pos": ((0.5, 0.5),), "modifier": None}
        self._send("ScenePointerMessage", event_type="click", ray_origin=origin, ray_direction=ray, **fields)

    @property
    def status(self) -> str:
        """The text at the head of the controls."""
        return self._where(lambda shown: "_markdown" in shown)["props"]["_markdown"]

    def shows(self, label: str) -> Any:
        """The value of a control."""
        return self._named(label)["value"]

    def options(self, label: str) -> list[str]:
        """What a list offers."""
        return list(self._named(label)["props"]["options"])

    def _named(self, label: str) -> dict[str, Any]:
        return self._where(lambda shown: shown.get("label") == label)

    def _where(self, fits: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        found: list[dict[str, Any]] = []
        wait_for(lambda: found.extend(c for c in list(self.controls.values()) if fits(c["props"])) or bool(found))
        return found[0]

    def _send(self, kind: str, **fields: Any) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def _read(self) -> None:
        try:
            for raw in self._socket:
                assert isinstance(raw, bytes)
                size, packed = (int.from_bytes(raw[at : at + 8], "little") for at in (0, 8))
                text = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
                for message in msgspec.msgpack.decode(text)["messages"]:
                    self._take(message)
        except ConnectionClosed:
            return

    def _take(self, message: dict[str, Any]) -> None:
        if message["type"] == "GuiUpdateMessage":
            for name, value in message["updates"].items():
                control = self.controls[message["uuid"]]
                (control if name == "value" else control["props"])[name] = value
        elif "uuid" in message and "props" in message:
            self.controls[message["uuid"]] = message


def wait_for(holds: Callable[[], bool], seconds: float = 30.0) -> None:
    """Until it holds; AssertionError where it does not come to."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it has not come to that"
        time.sleep(0.01)
