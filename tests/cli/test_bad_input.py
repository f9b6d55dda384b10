"""A user's mistake: exit status 2, one line on stderr, and nothing left behind."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from tests.cli.refusals import assert_refused

Murmillo = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the built-in clips, to be spoilt."""
    folder = tmp_path_factory.mktemp("pack") / "clips"
    shutil.copytree(str(files("murmillo.assets.motions") / "sword_shield"), folder)
    return folder


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("trian",), ("trian", "train")),
        (("train", "--fast"), ("--fast", "--multirun")),
        (("train", "sed=1"), ("sed", "seed")),
        (("train", "num_envs=0"), ("num_envs=0",)),
        (("train", "run.measured_worlds=0"), ("run.measured_worlds=0",)),
        (("train", "num_envs=4", "runner.horizon=32", "agent.ppo.minibatch=129"), ("agent.ppo.minibatch=129", "128")),
        (("train", "agent.window=2000"), ("agent.window=2000", "longer than every clip")),
        (("train", "agent=calm", "agent.encoder.frames=300"), ("agent.encoder.frames=300", "longer than every clip")),
        (("train", "skills=99"), ("skills=99", "labels", "block_high")),
        (("train", "motions=nowhere"), ("nowhere",)),
        (("train", "run.name=a/b"), ("run.name=a/b",)),
        (("train", "run.resume=runs/nothing"), ("run.resume=runs/nothing",)),
        (("train", "--multirun", "seed=1,x"), ("seed", "'x'")),
        (("evaluate",), ("run",)),
        (("evaluate", "run=runs/nothing"), ("run=runs/nothing",)),
        (("evaluate", "rum=x"), ("rum", "run")),
        (("evaluate", "run"), ("run", "name=value")),
        (("evaluate", "run=[x"), ("run=[x", "name=value")),
        (("evaluate", "run=${x}"), ("run", "not found")),
        (("evaluate", f"run={'x' * 300}"), ("there is no such run",)),
        (("evaluate", "run=x", "seed=-1"), ("seed=-1", "from 0")),
        (("train", "run.root=/dev/null/runs"), ("/dev/null/runs", "cannot be made", "run.root")),
        (("train", f"run.root={'x' * 300}"), ("cannot be made",)),
        (("train", f"run.name={'x' * 300}"), ("run.name=", "up to 200")),
        (("doctor", "now"), ("now",)),
    ],
)
def test_wrong_words(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    assert_refused(murmillo(*words), *parts)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("word", ["+runner.reward_weights.nothing=1", "agent.discriminator.dropout=3"])
def test_a_mistake_that_shows_late(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...], word: str) -> None:
    """The run's folder is there by then, alone in its root or beside another."""
    key = word.strip("+").rpartition(".")[2].partition("=")[0]
    assert_refused(murmillo("train", *tiny, word), key)
    assert list(folder.iterdir()) == []
    (folder / "runs" / "other").mkdir(parents=True)
    assert_refused(murmillo("train", *tiny, word), key)
    assert [path.name for path in (folder / "runs").iterdir()] == ["other"]


def test_an_empty_folder_of_clips(murmillo: Murmillo, folder: Path) -> None:
    (folder / "clips").mkdir()
    assert_refused(murmillo("train", "motions=clips"), "clips")
    assert [path.name for path in folder.iterdir()] == ["clips"]


def test_a_foreign_and_a_cut_off_file(murmillo: Murmillo, folder: Path, pack: Path) -> None:
    (folder / "foreign.npy").write_text("not an array")
    assert_refused(murmillo("train", "motions=foreign.npy"), "foreign.npy")
    shutil.copytree(pack, folder / "cut")
    clip = next((folder / "cut").glob("*.npz"))
    clip.write_bytes(clip.read_bytes()[:100])
    assert_refused(murmillo("train", "motions=cut"), clip.name)
    assert not (folder / "runs").exists()


def test_a_clip_with_nan(murmillo: Murmillo, folder: Path, pack: Path) -> None:
    shutil.copytree(pack, folder / "nan")
    clip = next((folder / "nan").glob("*.npz"))
    with np.load(clip) as arrays:
        spoilt = {
            name: np.where(np.arange(array.size).reshape(array.shape) == 7, np.nan, array)
            for name, array in arrays.items()
            if array.ndim == 2
        }
        kept = {name: array for name, array in arrays.items() if array.ndim != 2}
    np.savez(clip, **spoilt, **kept)
    assert_refused(murmillo("train", "motions=nan"), clip.name)
    assert not (folder / "runs").exists()


def test_a_run_that_is_there_already(murmillo: Murmillo, folder: Path) -> None:
    (folder / "runs" / "mine").mkdir(parents=True)
    assert_refused(murmillo("train", "run.name=mine"), "runs/mine", "run.name", "run.resume")
    assert list((folder / "runs" / "mine").iterdir()) == []


def test_a_reward_weight_without_a_reward(murmillo: Murmillo, folder: Path, tiny: tuple[str, ...]) -> None:
    """Found out in the first iteration, when the folder exists already: it goes again."""
    assert_refused(murmillo("train", *tiny, "warm_start.steps=0", "+runner.reward_weights.bounty=1"), "bounty")
    assert not (folder / "runs").exists() or list((folder / "runs").iterdir()) == []


@pytest.mark.parametrize("word", ["+runner.reward_weights.bounty=1", "runner.reward_weights.bounty=1"])
def test_a_resumption_that_fails_leaves_the_settings_as_they_were(murmillo: Murmillo, own_run: Path, word: str) -> None:
    before = {name: (own_run / name).read_bytes() for name in ("config.yaml", "versions.json", "scalars.csv")}
    assert_refused(murmillo("train", "run.resume=runs/tiny", "runner.samples=192", word))
    assert {name: (own_run / name).read_bytes() for name in before} == before
    assert murmillo("train", "run.resume=runs/tiny", "runner.samples=192")[0] == 0


def test_the_help_names_every_choice(murmillo: Murmillo) -> None:
    from murmillo.cli.config import compose_train

    text = murmillo("train", "--help")[1]
    for group in ("agent", "budget", "ablation"):
        for file in files("murmillo.conf").joinpath(group).iterdir():
            assert Path(file.name).stem in text
    assert f"num_envs   {compose_train([]).num_envs} " in text


def test_from_the_shell(folder: Path) -> None:
    """The console script itself: status, streams and no traceback."""
    command = [sys.executable, "-m", "murmillo.cli.main", "train", "sed=1"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "murmillo: sed: there is no such setting; did you mean seed?\n"


def test_a_reader_that_has_read_enough(folder: Path) -> None:
    """As `| head -1`: no traceback."""
    command = [sys.executable, "-m", "murmillo.cli.main", "motions", "list", "builtin"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert process.stderr.read() == ""
    assert process.returncode in (1, 141)  # 1 is what rich makes of it while it draws a table


@pytest.mark.parametrize("words", [(), ("--help",), ("train", "--help"), ("evaluate", "-h"), ("record", "--help")])
def test_help(murmillo: Murmillo, words: tuple[str, ...]) -> None:
    status, out, err = murmillo(*words)
    assert (status, err) == (0, "")
    assert out.startswith("murmillo")


def test_help_is_quick_because_it_imports_no_torch(folder: Path) -> None:
    code = (
        "import sys; from murmillo.cli.main import main; main(['train', '--help']);"
        "import json; print(json.dumps([name for name in ('torch', 'mujoco', 'hydra') if name in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == []
