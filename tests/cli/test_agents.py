"""Every agent on the real environment, from the command to the report."""

import csv
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from murmillo.cli.agents import AGENTS

Murmillo = Callable[..., tuple[int, str, str]]


def last_row(folder: Path) -> dict[str, str]:
    with (folder / "scalars.csv").open(newline="") as file:
        return list(csv.DictReader(file))[-1]


@pytest.mark.parametrize("agent", AGENTS)
def test_trains_resumes_and_is_measured(agent: str, murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    words = (f"agent={agent}", *tiny)
    assert murmillo("train", *words, "run.name=one", "runner.samples=64")[0] == 0
    status, _, err = murmillo("train", "run.resume=runs/one", "runner.samples=128")
    assert status == 0, err
    scalars = last_row(folder / "runs/one")
    assert scalars["samples"] == "128"
    assert all(math.isfinite(float(value)) for name, value in scalars.items() if not name.startswith("episode/"))
    measures = json.loads((folder / "runs/one/measures.json").read_text())
    assert list(measures) == ["untrained", "warm_started", "trained"]
    assert AGENTS[agent].labelled == bool(measures["trained"]["heads"])
    assert AGENTS[agent].labelled == (folder / "runs/one/skills.json").exists()
    assert (agent == "calm") == (measures["trained"]["concentration"] is not None)
    status, out, err = murmillo("evaluate", "run=runs/one", "worlds=2", "trajectories=1", "metrics=quality")
    assert status == 0, err
    assert ("Fisher concentration" in out) == (agent == "calm")
    assert ("commanded skill's head" in out) == AGENTS[agent].labelled


def test_residual_forces_reach_the_report(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    assert murmillo("train", "agent=case", "ablation=residual", *tiny, "run.name=helped", "runner.samples=64")[0] == 0
    assert 0 < float(last_row(folder / "runs/helped")["reward/residual"]) < 1
    assert json.loads((folder / "runs/helped/measures.json").read_text())["trained"]["residual_share"] > 0
    assert "Residual forces: after training" in (folder / "runs/helped/report.md").read_text()


def test_a_checkpoint_of_other_skills_is_refused(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    from murmillo.envs.character import load_character
    from murmillo.envs.motion import load_clips, save_clips

    assert murmillo("train", "agent=case", *tiny, "run.name=all", "runner.samples=64")[0] == 0
    save_clips(folder / "few", load_clips("builtin", load_character())[:3])
    status, _, err = murmillo("evaluate", "run=runs/all", "worlds=2", "motions=few")
    assert status == 2
    assert "the checkpoint" in err
    assert err.count("\n") == 1
