"""The gate of the benchmarks fails where a ratio has fallen or is missing, and says which; baselines are kept."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import gate
from benchmarks.record import FOLDER, JSON, Figure, Record
from murmillo.cli.benching.turns import Spread

RATIOS = {"environment step / bare mj_step": 0.8, "calm / ase": 0.5}


def results(ratios: dict[str, float], left_out: dict[str, str] | None = None, quick: bool = False) -> dict[str, Any]:
    spreads = {name: Spread(ratio, 0.9 * ratio, 1.1 * ratio) for name, ratio in ratios.items()}
    figures = [Figure("environment step", 7575.0, "control steps/s")]
    return Record(0.0, quick, figures, spreads, left_out or {}).as_json()


def baseline() -> dict[str, Any]:
    return gate.renewed({}, results(RATIOS))


def test_an_equal_run_passes() -> None:
    assert gate.compare(baseline(), results(RATIOS)) == ([], [])


def test_a_better_run_passes() -> None:
    assert gate.compare(baseline(), results({name: 2 * ratio for name, ratio in RATIOS.items()})) == ([], [])


@pytest.mark.parametrize(("part", "fails"), [(0.86, False), (0.84, True)])
def test_fifteen_per_cent_may_be_lost(part: float, fails: bool) -> None:
    failures, _ = gate.compare(baseline(), results(RATIOS | {"calm / ase": part * 0.5}))
    assert bool(failures) == fails


def test_a_fall_is_one_line_with_the_ratio_and_the_fall() -> None:
    (failure,), notes = gate.compare(baseline(), results(RATIOS | {"calm / ase": 0.4}))
    assert failure.startswith("calm / ase: 0.40 (0.36-0.44), 20% below the baseline's 0.50 (0.45-0.55) of ")
    assert "\n" not in failure
    assert notes == []


def test_a_missing_ratio_is_named_and_fails() -> None:
    (failure,), _ = gate.compare(baseline(), results({"calm / ase": 0.5}))
    assert failure.startswith("environment step / bare mj_step: missing")


def test_what_was_left_out_with_a_reason_passes_and_is_said() -> None:
    reasons = {"environment step / bare mj_step": "it is not installed"}
    failures, notes = gate.compare(baseline(), results({"calm / ase": 0.5}, reasons))
    assert failures == []
    assert notes == ["environment step / bare mj_step: left out, it is not installed"]


def test_a_new_ratio_passes_and_is_said() -> None:
    failures, notes = gate.compare(baseline(), results(RATIOS | {"case / ase": 0.9}))
    assert failures == []
    assert notes == ["case / ase: not in the baseline"]


def test_a_new_baseline_keeps_what_this_machine_cannot_measure() -> None:
    kept = {"on a GPU": {"median": 9.0, "low": 8.0, "high": 10.0, "machine": "another"}}
    renewed = gate.renewed(baseline() | kept, results({"calm / ase": 0.6}))
    assert renewed["on a GPU"] == kept["on a GPU"]
    assert renewed["environment step / bare mj_step"] == baseline()["environment step / bare mj_step"]
    assert renewed["calm / ase"]["median"] == 0.6
    assert "cores" in renewed["calm / ase"]["machine"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a place for results and baseline."""
    monkeypatch.chdir(tmp_path)
    FOLDER.mkdir(parents=True)
    return tmp_path


def write(run: dict[str, Any]) -> None:
    (FOLDER / JSON).write_text(json.dumps(run))


def test_from_a_baseline_to_a_fall(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(results(RATIOS))
    assert gate.main(["baseline"]) == 0
    assert gate.main(["compare"]) == 0
    assert "passed, 2 ratios" in capsys.readouterr().out
    write(results({"calm / ase": 0.1}))
    assert gate.main(["compare"]) == 1
    printed = capsys.readouterr().out
    assert "FAILED: calm / ase: 0.10" in printed
    assert "FAILED: environment step / bare mj_step: missing" in printed


def test_a_baseline_of_a_busy_machine_is_warned_of(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = results(RATIOS)
    write(run | {"load": 0.9 * run["machine"]["cores"]})
    assert gate.main(["baseline"]) == 0
    assert "was not idle" in capsys.readouterr().err


def test_refusals(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert gate.main([]) == 2
    assert "usage" in capsys.readouterr().err
    assert gate.main(["compare"]) == 2
    assert "make bench-baseline" in capsys.readouterr().err
    gate.BASELINE.write_text("{")
    assert gate.main(["compare"]) == 2
    assert "no JSON" in capsys.readouterr().err
    write(results(RATIOS, quick=True))
    assert gate.main(["baseline"]) == 2
    assert "quick trial" in capsys.readouterr().err


def test_the_table_says_machine_figures_ratios_and_what_was_left_out(folder: Path) -> None:
    figures = [Figure("environment step", 7575.4, "control steps/s", "1024 worlds", "4 x 1/120 s, 37 DoF")]
    ratios = {"calm / ase": Spread(0.789, 0.7, 0.9), "environment / EnvPool": Spread(12.34, 10.0, 15.0)}
    record = Record(0.25, False, figures, ratios, {"on a GPU": "there is none"})
    record.save(folder / "kept")
    table = (folder / "kept" / "benchmarks.md").read_text()
    for line in (
        "| environment step | 7,575 | control steps/s | 4 x 1/120 s, 37 DoF | 1024 worlds |",
        "| calm / ase | 0.79 (0.70-0.90) |",
        "| environment / EnvPool | 12.3 (10.0-15.0) |",
        "- left out: on a GPU: there is none",
    ):
        assert line in table.splitlines()
    assert "mujoco 4" in table
    assert "load before the run 0.2" in table
    assert json.loads((folder / "kept" / JSON).read_text()) == json.loads(json.dumps(record.as_json()))
