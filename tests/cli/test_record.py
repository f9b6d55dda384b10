"""Which clip a film's character follows at which moment, and a film of a tiny CALM from the command to the file."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from torch import Tensor

from murmillo.cli import gl, record
from murmillo.cli.errors import CommandError
from murmillo.cli.main import main

Murmillo = Callable[..., tuple[int, str, str]]

CLIPS = ("east", "north", "up")
AXES = torch.eye(3)


class Player:
    """Encodes the clip of number i as axis i, and remembers what it was told to follow."""

    encoder = SimpleNamespace(frames=4)

    def __init__(self) -> None:
        self.masks: Tensor | None = None

    def encode(self, motions: Tensor, mask: Tensor | None = None) -> Tensor:
        self.masks = mask
        return AXES[motions]

    def follow(self, latent: Tensor) -> None:
        self.followed = latent


class Library:
    clips = [SimpleNamespace(name=name) for name in CLIPS]  # noqa: RUF012
    mask: Tensor | None = None

    def middle(self, names: tuple[str, ...], frames: int) -> Tensor:
        assert frames == 4
        return torch.tensor([CLIPS.index(name) for name in names])


def followed(part: float, clips: tuple[str, ...], blend: bool) -> list[float]:
    player = Player()
    settings = record.RecordConfig("run", clips=clips, blend=blend)
    record._follower(settings, player, SimpleNamespace(library=Library()))(part)
    return player.followed.tolist()


@pytest.mark.parametrize(("part", "axis"), [(0.0, 2), (0.33, 2), (0.34, 0), (0.66, 0), (0.67, 1), (0.999, 1)])
def test_clips_are_followed_one_after_the_other_for_equal_times(part: float, axis: int) -> None:
    assert followed(part, ("up", "east", "north"), blend=False) == AXES[axis].tolist()


def test_blended_clips_lie_evenly_along_the_film() -> None:
    half = 0.5**0.5
    for part, latent in (
        (0.0, [1.0, 0.0, 0.0]),
        (0.25, [half, half, 0.0]),
        (0.5, [0.0, 1.0, 0.0]),
        (0.75, [0.0, half, half]),
        (0.9999, [0.0, 0.0, 1.0]),
    ):
        assert followed(part, CLIPS, blend=True) == pytest.approx(latent, abs=1e-3)


def test_what_a_clip_leaves_out_is_left_out_of_its_encoding() -> None:
    player, library = Player(), Library()
    library.mask = torch.tensor([[True], [False], [True]])
    record._follower(record.RecordConfig("run", clips=("north", "up")), player, SimpleNamespace(library=library))
    assert player.masks is not None
    assert player.masks.tolist() == [[False], [True]]


def test_an_agent_that_follows_no_clips() -> None:
    settings = record.RecordConfig("run", clips=("up",))
    with pytest.raises(CommandError, match="agent=calm"):
        record._follower(settings, SimpleNamespace(), SimpleNamespace(library=Library()))


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("seconds=0",), ("seconds=0", "above 0")),
        (("seconds=nan",), ("seconds=nan", "above 0")),
        (("seconds=inf",), ("seconds=inf", "above 0")),
        (("seed=-1",), ("seed=-1", "from 0")),
        (("clips=[walk_forward,kick",), ("clips=[walk_forward,kick", "name=value")),
        (("clips=walk_forward",), ("clips", "a list such as [a,b]")),
        (("blend=true",), ("blend=true", "clips=[")),
        (("out=film.avi",), ("out=film.avi", ".mp4")),
        (("out=no/film.mp4",), ("out=no/film.mp4", "a folder that exists")),
        (("out=./folder.mp4",), ("out=./folder.mp4", "a file name")),
        (("camra=side",), ("camra", "camera")),
    ],
)
def test_mistakes(
    murmillo: Murmillo, own_run: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, words: tuple, parts: tuple
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")  # nothing is drawn, and nothing looked for
    (folder / "folder.mp4").mkdir()
    status, _, err = murmillo("record", "run=runs/tiny", *words)
    assert status == 2
    assert err.count("\n") == 1, err
    for part in parts:
        assert part in err
    assert sorted(path.name for path in folder.iterdir()) == ["folder.mp4", "runs"]


def test_without_opengl_the_back_end_that_was_tried_is_named(
    murmillo: Murmillo, own_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    assert "(tried off)" in murmillo("record", "run=runs/tiny")[2]


def test_a_film_along_clips(folder: Path, tiny: tuple[str, ...]) -> None:
    if all(gl.why_not(backend) for backend in gl.candidates()):
        pytest.skip("no OpenGL draws on this machine")
    assert main(["train", "agent=calm", *tiny, "runner.samples=64", "run.name=calm"]) == 0
    run = [sys.executable, "-m", "murmillo.cli.main", "record", "run=runs/calm", "seconds=0.2", "out=./path.mp4"]
    done = subprocess.run(
        [*run, "clips=[walk_forward,kick]", "blend=true"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"ftyp" in (folder / "path.mp4").read_bytes()[:16]
    done = subprocess.run([*run, "clips=[walk_forwrd]", "camera=side"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("murmillo: clip walk_forwrd: there is none of that name; near it are: walk_forward")
    assert done.stderr.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["path.mp4", "runs"]
