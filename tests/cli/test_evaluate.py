"""`murmillo evaluate` on a tiny run: what it writes, how it goes on, and what it refuses."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from murmillo.agents.common import checkpoint
from murmillo.cli import runs
from murmillo.cli.evaluation import bench, history
from murmillo.cli.evaluation.chunks import ChunkStore
from murmillo.cli.evaluation.kept import kept_checkpoints
from murmillo.cli.evaluation.published import CONDITIONS, METHODS, PUBLISHED
from murmillo.cli.evaluation.table import METRICS, NEEDS
from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips
from murmillo.envs.motion.files import save_clips
from tests.cli.refusals import assert_refused

Murmillo = Callable[..., tuple[int, str, str]]

STEPS = 40
"""Of a trajectory in these tests; a protocol of full length is a second of simulation for each of its ten."""

FEW = ("run=runs/tiny", "trajectories=3", "worlds=0")


@pytest.fixture(autouse=True)
def short_protocols(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, metric in METRICS.items():
        short = [replace(protocol, steps=STEPS, switch=protocol.switch and (20, 25)) for protocol in metric.protocols]
        monkeypatch.setitem(METRICS, name, metric._replace(protocols=tuple(short)))


def results(folder: Path) -> dict[str, Any]:
    return json.loads((folder / runs.METRICS).read_text())


def figures(folder: Path) -> dict[str, Any]:
    """Without the times that they took."""
    return {name: metric["figures"] for name, metric in results(folder)["metrics"].items()}


def test_the_quick_set(murmillo: Murmillo, own_run: Path) -> None:
    status, out, err = murmillo("evaluate", "run=runs/tiny", "trajectories=3", "worlds=2")
    assert status == 0, err
    found = results(own_run)
    assert list(found["metrics"]) == ["coverage", "frechet", "diversity", "quality"]
    assert set(found["left_out"]) == {"concentration", "residual"}
    assert found["samples"] == 128
    assert found["not_comparable"] is None
    assert list(found["ages"]) == ["untrained", "warm_started", "trained"]
    assert found["ages"]["trained"]["episodes"] == 2
    assert 0.0 < found["ages"]["trained"]["score"] < 1.0
    assert found["ages"]["trained"]["length"] * 2 == pytest.approx(found["ages"]["trained"]["steps"])
    coverage = found["metrics"]["coverage"]["figures"]["coverage"]["values"]
    assert coverage["replayed"] == {"value": pytest.approx(3 / 45), "samples": 3, "spread": None, "spread_of": None}
    assert coverage["trained"]["samples"] == 3
    assert "Coverage" in out
    text = (own_run / runs.EVALUATED).read_text()
    assert "| Coverage, filter 10 % ↑ |" in text
    assert "| 66.0 % |" in text
    assert "before training" in text
    assert (own_run / runs.HISTORY).read_text().splitlines()[1].startswith("128,")


def test_the_page_needs_nothing_beside_it(murmillo: Murmillo, own_run: Path) -> None:
    assert murmillo("evaluate", *FEW, "metrics=[coverage,diversity]")[0] == 0
    page = (own_run / runs.EVALUATED_HTML).read_text()
    pictures = list((own_run / "evaluation" / "plots").glob("*.png"))
    assert {picture.stem for picture in pictures} >= {"coverage", "frequencies"}
    sources = re.findall(r'src="([^"]{0,30})', page)
    assert len(sources) == len(pictures)
    assert all(source.startswith("data:image/png;base64,iVBOR") for source in sources)
    assert not re.search(r"<(script|link|iframe)|https?://|url\(", page)
    assert "<table>" in page


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "CHUNK", 2)


@pytest.mark.usefixtures("small_chunks")
def test_stopped_and_taken_up_again_it_ends_in_the_same_figures(
    murmillo: Murmillo, own_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("trajectories=3", "worlds=0", "metrics=[coverage,quality]")
    whole = Path(shutil.copytree(own_run, own_run.parent / "whole"))
    assert murmillo("evaluate", "run=runs/whole", *words)[0] == 0

    save, saved = ChunkStore.save, []

    def save_once(self: ChunkStore, source: str, protocol: str, number: int, chunk: Any) -> None:
        save(self, source, protocol, number, chunk)
        saved.append((source, protocol, number))
        if len(saved) == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(ChunkStore, "save", save_once)
    status, out, _ = murmillo("evaluate", "run=runs/tiny", *words)
    assert status == 130
    assert out.splitlines()[-1].endswith(
        "go on with: murmillo evaluate run=runs/tiny trajectories=3 worlds=0 metrics=[coverage,quality]"
    )
    assert not (own_run / runs.METRICS).exists()
    assert murmillo("evaluate", "run=runs/tiny", *words)[0] == 0
    assert len(saved) == len(set(saved)) == 6  # none was recorded twice
    assert figures(own_run) == figures(whole)

    # more trajectories use those that there are; another seed begins anew
    assert murmillo("evaluate", "run=runs/tiny", "trajectories=5", *words[1:])[0] == 0
    assert len(saved) == 9
    assert murmillo("evaluate", "run=runs/tiny", "seed=2", *words)[0] == 0
    assert len(saved) == 15


# as the fixtures have it, but in a process of its own, which a signal can reach wherever it is
INTERRUPTED = f"""
import sys
from dataclasses import replace
from murmillo.cli.evaluation import bench
from murmillo.cli.evaluation.table import METRICS
from murmillo.cli.main import main
bench.CHUNK = 2
METRICS["coverage"] = METRICS["coverage"]._replace(
    protocols=tuple(replace(protocol, steps={STEPS}) for protocol in METRICS["coverage"].protocols)
)
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_a_signal_leaves_chunks_and_a_line_and_the_work_goes_on(murmillo: Murmillo, own_run: Path) -> None:
    words = ("trajectories=24", "worlds=0", "metrics=coverage")
    whole = Path(shutil.copytree(own_run, own_run.parent / "whole"))
    command = [sys.executable, "-c", INTERRUPTED, "evaluate", "run=runs/tiny", *words]
    chunks = own_run / "evaluation" / "chunks"
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.poll() is None and not list(chunks.glob("*/*.safetensors")):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err == ""
    assert out.splitlines()[-1] == (
        "stopped; what is recorded stays, go on with: murmillo evaluate run=runs/tiny "
        "trajectories=24 worlds=0 metrics=coverage"
    )
    assert not (own_run / runs.METRICS).exists()
    left = {path: path.stat().st_mtime_ns for path in chunks.glob("*/*.safetensors")}
    assert 0 < len(left) < 36  # 12 of each source

    assert murmillo("evaluate", "run=runs/tiny", *words)[0] == 0
    assert murmillo("evaluate", "run=runs/whole", *words)[0] == 0
    assert figures(own_run) == figures(whole)
    assert {path: path.stat().st_mtime_ns for path in left} == left
    assert len(list(chunks.glob("*/*"))) == 36  # and no half-written one


def test_the_checkpoints_that_a_run_kept_make_a_curve(
    murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    words = (*tiny, "runner.samples=256", "run.keep_every=100", "warm_start.steps=0", "run.name=long")
    assert murmillo("train", *words)[0] == 0
    run = folder / "runs" / "long"
    kept = kept_checkpoints(run)
    assert list(kept) == [128, 256]  # the first past 100 and past 200
    assert checkpoint.load(kept[128])["agent"].keys().isdisjoint({"latents", "replay"})

    saved, save = [], ChunkStore.save
    monkeypatch.setattr(ChunkStore, "save", lambda self, *what: (saved.append(what[0]), save(self, *what)))
    measured = ("evaluate", "run=runs/long", "checkpoint=all", "trajectories=3", "worlds=0")
    assert murmillo(*measured, "metrics=coverage")[0] == 0
    assert saved == ["trained", "trained", "untrained", "replayed"]  # at 128 samples the policy alone
    assert [row["samples"] for row in history.read(run / runs.HISTORY)] == ["128", "256"]
    assert (run / "evaluation" / "plots" / "history.png").is_file()
    assert "Coverage against training samples" in (run / runs.EVALUATED).read_text()
    assert results(run)["samples"] == 256

    saved.clear()
    assert murmillo(*measured, "metrics=[coverage]")[0] == 0
    assert saved == []
    assert murmillo(*measured, "metrics=quality")[0] == 0
    assert [{"coverage", "jerk"} <= row.keys() for row in history.read(run / runs.HISTORY)] == [True, True]
    assert not list((run / "evaluation").glob("chunks-*"))


def test_metrics_that_were_measured_before_stay(murmillo: Murmillo, own_run: Path) -> None:
    for metric in ("quality", "coverage"):
        assert murmillo("evaluate", *FEW, f"metrics={metric}")[0] == 0
    assert list(results(own_run)["metrics"]) == ["coverage", "quality"]
    assert len((own_run / runs.HISTORY).read_text().splitlines()) == 2
    assert murmillo("evaluate", *FEW, "metrics=coverage", "start=reference")[0] == 0
    assert list(results(own_run)["metrics"]) == ["coverage"]
    assert len((own_run / runs.HISTORY).read_text().splitlines()) == 3


def test_other_clips_are_not_comparable(murmillo: Murmillo, own_run: Path, folder: Path) -> None:
    clips = load_clips("builtin", load_character())
    save_clips(folder / "fewer", clips[1:])
    status, out, err = murmillo("evaluate", *FEW, "metrics=coverage", "motions=fewer")
    assert status == 0, err
    assert f"not comparable: 1 clip differs from those that the run learned from ({clips[0].name})" in out
    assert "**Not comparable**" in (own_run / runs.EVALUATED).read_text()
    assert not (own_run / runs.HISTORY).exists()


def test_moved_clips_are_the_same_clips(murmillo: Murmillo, own_run: Path, folder: Path) -> None:
    save_clips(folder / "moved", load_clips("builtin", load_character()))
    assert murmillo("evaluate", *FEW, "metrics=coverage", "motions=moved")[0] == 0
    assert results(own_run)["not_comparable"] is None


def test_training_ends_with_the_quick_set(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    words = [word for word in tiny if not word.startswith("run.evaluate")]
    status, _, err = murmillo("train", *words, "runner.samples=64", "warm_start.steps=0", "run.name=whole")
    assert status == 0, err
    run = folder / "runs" / "whole"
    report = (run / runs.REPORT).read_text()
    assert "(evaluation.md)" in report
    assert "| Coverage ↑ |" in report
    assert results(run)["trajectories"] == 2
    assert len(json.loads((run / runs.CLIPS).read_text())) == 45


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("metrics=[covrage]",), ("covrage", "did you mean coverage")),
        (("metrics=[controllability]",), ("controllability", NEEDS["commands"])),
        (("metrics=[quick,concentration]",), ("concentration", NEEDS["encoder"])),
        (("metrics=residual",), ("residual", NEEDS["residual"])),
        (("metrics=[]",), ("metrics=[]",)),
        (("trajectories=0",), ("trajectories=0",)),
        (("worlds=-1",), ("worlds=-1",)),
        (("start=lying",), ("start", "lying")),
        (("motions=nowhere",), ("nowhere",)),
        (("checkpoint=best",), ("checkpoint", "best")),
        (("checkpoint=all",), ("kept none", "run.keep_every=SAMPLES")),
    ],
)
def test_wrong_words(murmillo: Murmillo, own_run: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo("evaluate", "run=runs/tiny", *words), *parts)
    assert not (own_run / "evaluation").exists()


def test_a_run_without_a_checkpoint(murmillo: Murmillo, own_run: Path) -> None:
    shutil.rmtree(own_run / runs.LAST)
    status, _, err = murmillo("evaluate", *FEW)
    assert status == 2
    assert "is no checkpoint" in err
    assert err.count("\n") == 1
    assert not (own_run / "evaluation").exists()


@pytest.mark.parametrize(
    ("agent", "metrics"), [("case", ["controllability", "inception"]), ("calm", ["concentration"])]
)
def test_agents_that_are_told_what_to_do(
    murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], agent: str, metrics: list[str]
) -> None:
    """A classifier knows the replayed clips, and not what two iterations have taught; an encoder has its maps."""
    words = (*tiny, f"agent={agent}", "runner.samples=64", "warm_start.steps=0", "run.name=tiny")
    status, _, err = murmillo("train", *words)
    assert status == 0, err
    status, _, err = murmillo("evaluate", "run=runs/tiny", "trajectories=45", "worlds=0", f"metrics={metrics}")
    assert status == 0, err
    run = folder / "runs" / "tiny"
    found = figures(run)
    assert list(found) == [name for name in METRICS if name in metrics]
    if agent == "case":
        seen = found["controllability"]["controllability"]["values"]
        assert seen["replayed"]["value"] > 0.7
        assert seen["trained"]["value"] < 0.2  # chance is 1 in 45
        assert found["inception"]["inception"]["values"]["replayed"]["value"] > 10.0
        curves = json.loads((run / "evaluation" / "curves.json").read_text())["controllability"]
        names, matrix = curves["replayed"]["names"], np.array(curves["replayed"]["seen"])
        assert matrix.shape == (len(names), len(names) + 1)  # the last is a pose that is held
        asked = matrix.sum(1) > 0
        np.testing.assert_allclose(matrix[asked].sum(1), 1.0)
        assert np.diag(matrix)[asked].mean() > 0.7
        assert (run / "evaluation" / "plots" / "obeyed.png").is_file()
    else:
        values = found["concentration"]["concentration"]["values"]
        assert 0.0 < values["trained"]["value"] < 1.0
        assert set(values) == {"trained", "untrained"}  # clips encode nothing
        assert (run / "evaluation" / "plots" / "latents.png").is_file()


def test_published_figures_belong_to_figures_that_there_are() -> None:
    known = {kind.name for metric in METRICS.values() for kind in metric.figures}
    for entry in PUBLISHED:
        assert entry.figure in known
        assert entry.method in METHODS
        assert entry.paper in CONDITIONS
