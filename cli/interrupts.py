"""Ctrl-C while libraries are imported: some of them crash where an exception cuts their start short."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

BROKEN_OFF = "murmillo: broken off"
STATUS = 130
_IMPORTLIB = "<frozen importlib"


@contextmanager
def interruptible() -> Iterator[None]:
    """Within, Ctrl-C raises KeyboardInterrupt as ever, but in the midst of an import it ends the process at once."""
    before = signal.getsignal(signal.SIGINT)
    # somebody else's handler stays; only the main thread may set one
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith(_IMPORTLIB):
            os.write(2, f"{BROKEN_OFF}\n".encode())
            os._exit(STATUS)
        frame = frame.f_back
    raise KeyboardInterrupt
