"""Ctrl-C in the midst of an import, where an exception could crash a library, and elsewhere."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from murmillo.cli.interrupts import interruptible


def test_within_an_import_the_process_ends_with_a_line(tmp_path: Path) -> None:
    (tmp_path / "heavy.py").write_text(
        "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\nexcept BaseException:\n    print('raised')\n"
    )
    code = "from murmillo.cli.interrupts import interruptible as it\nwith it():\n    import heavy\nprint('went on')"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "murmillo: broken off\n")


def test_elsewhere_it_raises_and_leaves_the_handler_as_it_was() -> None:
    with pytest.raises(KeyboardInterrupt), interruptible():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_another_handler_is_kept() -> None:
    caught: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: caught.append(number))
    try:
        with interruptible():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    assert caught == [signal.SIGINT]
