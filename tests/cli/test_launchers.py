"""Sweeps through hydra's launchers: who shares the cores, and two runs by each that needs no cluster."""

from collections.abc import Callable
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from murmillo.cli import launchers, runs, versions
from murmillo.cli.launchers import chosen, shared_out

Murmillo = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize(
    ("launcher", "given", "threads"),
    [
        ("joblib", (), "2"),  # eight cores for four runs at a time
        ("joblib", ("hydra.launcher.n_jobs=2",), "4"),
        ("joblib", ("hydra.launcher.n_jobs=20",), "1"),
        ("submitit_local", (), "2"),
        ("ray", ("hydra.launcher.ray.remote.num_cpus=3",), "3"),
        ("submitit_slurm", (), None),
        (None, (), None),
        ("joblib", ("threads=7",), "7"),
    ],
)
def test_the_runs_share_out_the_cores(
    launcher: str | None, given: tuple[str, ...], threads: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(versions, "usable_cores", lambda: 8)
    words = shared_out(list(given), launcher, runs=4)
    settings = dict(word.split("=", 1) for word in words)
    assert settings.get("threads") == threads
    assert len(settings) == len(words)  # nothing is said twice
    if launcher == "joblib":
        assert settings["hydra.launcher.n_jobs"] == dict(w.split("=") for w in given).get("hydra.launcher.n_jobs", "4")


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("hydra/launcher=jolib", "seed=1,2"), ("hydra/launcher=jolib", "did you mean joblib")),
        (("hydra/launcher=joblib", "hydra.launcher.n_jobs=many"), ("hydra.launcher.n_jobs=many", "at least 1")),
        (("hydra/launcher=joblib", "task=reach", "low=none"), ("hydra/launcher=joblib", "one after the other")),
    ],
)
def test_a_launcher_that_cannot_be_is_refused_in_one_line(
    murmillo: Murmillo, words: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    status, _, err = murmillo("train", "--multirun", *words)
    assert status == 2
    assert err.count("\n") == 1
    assert all(part in err for part in parts)


def test_a_plugin_that_is_missing_is_named(murmillo: Murmillo, monkeypatch: pytest.MonkeyPatch) -> None:
    absent = launchers.Launcher("hydra_absent_launcher", "murmillo[sweeps]")
    monkeypatch.setitem(launchers.LAUNCHERS, "joblib", absent)
    status, _, err = murmillo("train", "--multirun", "hydra/launcher=joblib", "seed=1,2")
    assert status == 2
    assert err == "murmillo: hydra/launcher=joblib: its plugin is not installed; pip install 'murmillo[sweeps]'\n"


def test_every_launcher_has_its_settings() -> None:
    files = Path(launchers.__file__).parents[1] / "conf" / "launcher"
    assert {path.stem for path in files.glob("*.yaml")} == set(launchers.LAUNCHERS)
    assert chosen(["hydra/launcher=basic"]) is None


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_two_runs_by_a_launcher(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], launcher: str) -> None:
    pytest.importorskip(f"hydra_plugins.{launchers.LAUNCHERS[launcher].plugin}")
    words = [word for word in tiny if not word.startswith("threads=")]
    small = ("runner.samples=64", "warm_start.steps=0", "run.measured_worlds=1")
    status, _, err = murmillo("train", "--multirun", f"hydra/launcher={launcher}", *words, *small, "seed=1,2")
    assert status == 0, err
    made = sorted((folder / "runs").iterdir(), key=lambda run: run.name[20:])  # not by the second that they began in
    assert [run.name[20:] for run in made] == ["ase-smoke-1-0", "ase-smoke-2-1"]
    assert all((run / runs.REPORT).is_file() for run in made)
    share = max(1, versions.usable_cores() // 2)
    assert [OmegaConf.load(run / runs.CONFIG).threads for run in made] == [share, share]
