"""What the runner warns of is said at once, kept with the run and listed in its report."""

from collections.abc import Callable
from pathlib import Path

from murmillo.cli import report, runs

Murmillo = Callable[..., tuple[int, str, str]]

ALWAYS = ("runner.watch.quiet=0", "runner.watch.memory=1", "runner.watch.accuracy=-1")
"""Every discriminator has won by these."""


def test_a_warning_is_said_and_kept(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    run = folder / "runs" / "warned"
    status, out, err = murmillo("train", *tiny, *ALWAYS, "runner.watch.accuracy_iterations=2", "run.name=warned")
    assert status == 0, err
    assert out.count("warning: the discriminator has been right on") == 1
    (notice,) = runs.read_json(run / runs.NOTICES)
    assert (notice["failure"], notice["samples"], notice["over"]) == ("discriminator", 128, None)

    status, out, err = murmillo("train", "run.resume=runs/warned", "runner.samples=320", "runner.watch.accuracy=1")
    assert status == 0, err
    assert "warning" not in out
    assert runs.read_json(run / runs.NOTICES) == [{**notice, "over": 256}]
    text = (run / runs.REPORT).read_text()
    assert f"## What to look at\n\n- At 128 samples: {notice['text']}. (Over at 256.)" in text


def test_no_patience_is_refused(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    status, _, err = murmillo("train", *tiny, "runner.watch.memory=0")
    assert status == 2
    assert err.count("\n") == 1
    assert "runner.watch.memory=0: needs at least 1" in err
    assert not (folder / "runs").exists()


def test_a_run_without_warnings_has_no_such_section(own_run: Path) -> None:
    assert runs.read_json(own_run / runs.NOTICES) == []
    assert "What to look at" not in report.write(own_run).read_text()
