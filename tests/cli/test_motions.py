"""`murmillo motions`: looking at clips, changing them, and the mistakes one can make."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from murmillo.envs.character import load_character
from murmillo.envs.motion import Clip, load_clips, save_clips
from murmillo.envs.motion.editing import trim
from murmillo.envs.motion.manifest import MANIFEST
from tests.cli.conftest import Done
from tests.cli.refusals import assert_refused

Murmillo = Callable[..., Done]
CHARACTER = load_character("sword_shield")


@pytest.fixture(scope="module")
def builtin() -> dict[str, Clip]:
    return {clip.name: clip for clip in load_clips("builtin", CHARACTER)}


@pytest.fixture
def pair(folder: Path, builtin: dict[str, Clip]) -> str:
    """A folder of two clips, in the working folder."""
    save_clips(folder / "pair", [builtin["guard"], builtin["turn_left_90"]])
    return "pair"


def loaded(path: str) -> dict[str, Clip]:
    return {clip.name: clip for clip in load_clips(path, CHARACTER)}


def test_list(murmillo: Murmillo, pair: str, builtin: dict[str, Clip]) -> None:
    done = murmillo("motions", "list", pair)
    assert (done.status, done.err) == (0, "")
    header, guard, turn, total, terms = done.out.splitlines()
    assert header.split()[:4] == ["clip", "label", "seconds", "frames"]
    assert guard.split()[:6] == [
        "guard",
        "guard",
        f"{builtin['guard'].duration:.2f}",
        str(builtin["guard"].frames),
        "30",
        "loop",
    ]
    assert "turn_left_90" in turn
    assert "CC0-1.0" in turn
    assert total.startswith("2 clips of 2 labels for sword_shield")
    assert "may be passed on freely" in terms


def test_list_of_the_built_in_pack(murmillo: Murmillo, builtin: dict[str, Clip]) -> None:
    out = murmillo("motions", "list", "builtin").out
    assert len(out.splitlines()) == len(builtin) + 3


def test_inspect_tells_each_fault_with_its_frame(murmillo: Murmillo, folder: Path, builtin: dict[str, Clip]) -> None:
    qpos = builtin["guard"].qpos.copy()
    qpos[30:, 0] += 0.05
    slid = replace(builtin["guard"], name="slid", qpos=qpos)
    save_clips("faulty", [builtin["guard"], slid])
    table = murmillo("motions", "inspect", "faulty").out
    assert "slide 29" in table
    assert "1 of 2 clips show nothing suspicious" in table
    one = murmillo("motions", "inspect", "faulty", "--clip", "slid", "--tracking").out
    assert "frame 29, slide: the" in one
    assert "slides 5.0 cm in a control step" in one
    assert "followed" in one


def test_trim(murmillo: Murmillo, pair: str, builtin: dict[str, Clip]) -> None:
    done = murmillo("motions", "trim", pair, "--clip", "guard", "--start", "1", "--end", "2", "--to", "cut")
    assert (done.status, done.err) == (0, "")
    clips = loaded("cut")
    assert clips["guard"].qpos.tolist() == builtin["guard"].qpos[30:61].tolist()
    assert clips["turn_left_90"].frames == builtin["turn_left_90"].frames


def test_a_folder_can_be_changed_in_place(murmillo: Murmillo, pair: str) -> None:
    words = ("motions", "trim", pair, "--clip", "guard", "--end", "2", "--to", pair)
    refused = murmillo(*words)
    assert refused.status == 2
    assert "--replace" in refused.err
    assert loaded(pair)["guard"].duration > 2.0
    assert murmillo(*words, "--replace").status == 0
    assert loaded(pair)["guard"].duration == 2.0


def test_mirror(murmillo: Murmillo, pair: str) -> None:
    assert murmillo("motions", "mirror", pair, "--to", "both").status == 0
    clips = loaded("both")
    assert list(clips) == ["guard", "turn_left_90", "guard_mirrored", "turn_right_90"]
    assert clips["turn_right_90"].label == "turn_right_90"
    assert clips["turn_right_90"].masked == ("sword", "shield")
    assert murmillo("motions", "mirror", pair, "--clip", "guard", "--only", "--to", "one").status == 0
    assert list(loaded("one")) == ["guard_mirrored"]


def test_mirror_images_of_a_pair_keep_names_apart(murmillo: Murmillo, builtin: dict[str, Clip], folder: Path) -> None:
    save_clips("turns", [builtin["turn_left_90"], builtin["turn_right_90"]])
    assert murmillo("motions", "mirror", "turns", "--to", "both").status == 0
    clips = loaded("both")
    assert list(clips) == ["turn_left_90", "turn_right_90", "turn_right_90_mirrored", "turn_left_90_mirrored"]
    assert clips["turn_right_90_mirrored"].label == "turn_right_90"


def test_mirrored_again_every_image_has_a_name(murmillo: Murmillo, pair: str) -> None:
    assert murmillo("motions", "mirror", pair, "--to", "both").status == 0
    assert murmillo("motions", "mirror", "both", "--to", "again").status == 0
    assert list(loaded("again"))[4:] == [
        "guard_mirrored_mirrored",
        "turn_right_90_mirrored",
        "guard_mirrored_mirrored_2",
        "turn_left_90_mirrored",
    ]


def test_clips_are_told_apart_whatever_the_case_of_letters(builtin: dict[str, Clip]) -> None:
    from murmillo.cli.motions.clips import told_apart

    new = [replace(builtin["guard"], name=name) for name in ("Walk", "run", "Run", "run_2")]
    assert [clip.name for clip in told_apart(new, ["walk"])] == ["Walk_2", "run", "Run_2", "run_2_2"]


def test_label_by_name_and_by_file(murmillo: Murmillo, pair: str, folder: Path) -> None:
    assert murmillo("motions", "label", pair, "--by", "from-name", "--rule", "content", "--to", "a").status == 0
    assert {name: clip.label for name, clip in loaded("a").items()} == {"guard": "guard", "turn_left_90": "turn"}
    (folder / "labels.csv").write_text("guard,stand\nturn_left_90,turn\n")
    done = murmillo("motions", "label", pair, "--by", "file", "--file", "labels.csv", "--to", "b")
    assert "2 labels: stand (1), turn (1)" in done.out
    assert loaded("b")["guard"].label == "stand"


def test_label_by_similarity_and_chance(murmillo: Murmillo, folder: Path) -> None:
    pytest.importorskip("scipy", reason="clustering needs the motion extra: pip install murmillo[motion]")
    for by, label in (("cluster", "cluster_02"), ("random", "random_02")):
        done = murmillo("motions", "label", "builtin", "--by", by, "--groups", "2", "--to", by)
        assert done.status == 0, done.err
        assert label in done.out
        assert len({clip.label for clip in loaded(by).values()}) == 2


def test_label_by_example_tells_the_accuracy(murmillo: Murmillo, pair: str, builtin: dict[str, Clip]) -> None:
    known = [
        replace(trim(builtin[name], 0.5 * i, 0.5 * i + 1.0), name=f"{name}_{i}", label=name)
        for name in ("guard", "turn_left_90")
        for i in range(2)
    ]
    save_clips("known", known)
    done = murmillo("motions", "label", pair, "--by", "classify", "--from", "known", "--to", "out")
    assert done.status == 0, done.err
    assert "held-out accuracy" in done.out
    assert "of 1 clips" in done.out
    assert {clip.label for clip in loaded("out").values()} <= {"guard", "turn_left_90"}


def test_preview(murmillo: Murmillo, folder: Path, builtin: dict[str, Clip], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)  # the command chooses one; this takes its choice back
    save_clips("short", [trim(builtin["kick"], 1.0, 1.1)])
    done = murmillo("motions", "preview", "short", "--to", "pictures", "--film")
    if "no OpenGL" in done.err:
        pytest.skip("no OpenGL draws on this machine")
    assert done.status == 0, done.err
    assert [path.name for path in (folder / "pictures").iterdir()] == ["kick.mp4"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (("lst",), ("lst", "list")),
        (("list",), ("motions list", "path", "--help")),
        (("list", "nowhere"), ("murmillo: nowhere: there is no such file or folder",)),
        (("list", "builtin", "--chracter", "x"), ("--chracter", "--character")),
        (("list", "builtin", "more"), ("more", "no such option")),
        (("list", "builtin", "--character", "dragon"), ("--character=dragon", "sword_shield")),
        (("inspect", "builtin", "--clip", "gaurd"), ("--clip gaurd", "guard")),
        (("preview", "builtin"), ("motions preview", "--to")),
        (("trim", "builtin", "--clip", "guard", "--start", "9", "--to", "out"), ("guard", "9", "lasts")),
        (("trim", "builtin", "--clip", "guard", "--start", "soon", "--to", "out"), ("--start", "soon")),
        (("trim", "builtin", "--clip", "guard", "--to", "out", "--end", "0"), ("guard", "0 s")),
        (("mirror", "builtin", "--to", "full"), ("full", "other files")),
        (("mirror", "builtin", "--to", "file/out"), ("file/out", "cannot be written")),
        (("label", "builtin", "--by", "magic", "--to", "out"), ("magic", "from-name")),
        (("label", "builtin", "--by", "cluster", "--to", "out"), ("--by cluster", "--groups")),
        (("label", "builtin", "--by", "classify", "--to", "out"), ("--by classify", "--from")),
        (("label", "builtin", "--by", "random", "--groups", "999", "--to", "out"), ("--groups=999",)),
        (("label", "builtin", "--by", "random", "--groups", "2", "--seed", "-1", "--to", "out"), ("--seed=-1",)),
        (("list", "x" * 300), ("no such file or folder",)),
        (("label", "builtin", "--by", "from-name", "--rule", "(", "--to", "out"), ("rule", "content")),
        (("label", "builtin", "--by", "file", "--file", "no.csv", "--to", "out"), ("no.csv", "cannot be read")),
    ],
)
def test_mistakes(murmillo: Murmillo, folder: Path, words: tuple[str, ...], parts: tuple[str, ...]) -> None:
    """One line, exit status 2, and nothing written."""
    (folder / "full").mkdir()
    (folder / "full/notes.txt").touch()
    (folder / "file").touch()
    done = murmillo("motions", *words)
    assert_refused(done, *parts)
    assert sorted(path.name for path in folder.rglob("*")) == ["file", "full", "notes.txt"]


def test_a_manifest_of_an_unknown_character(murmillo: Murmillo, pair: str, folder: Path) -> None:
    manifest = json.loads((folder / pair / MANIFEST).read_text())
    (folder / pair / MANIFEST).write_text(json.dumps(manifest | {"character": "dragon"}))
    done = murmillo("motions", "list", pair)
    assert done.status == 2
    assert "character=dragon" in done.err


def test_a_damaged_clip(murmillo: Murmillo, pair: str, folder: Path) -> None:
    (folder / pair / "guard.npz").write_bytes(b"PK")
    done = murmillo("motions", "inspect", pair)
    assert (done.status, done.err.count("\n")) == (2, 1)
    assert "guard.npz" in done.err
    shutil.rmtree(folder / pair)


@pytest.mark.parametrize("words", [(), ("--help",), ("import", "--help"), ("label", "-h"), ("preview", "x", "--help")])
def test_help(murmillo: Murmillo, words: tuple[str, ...]) -> None:
    done = murmillo("motions", *words)
    assert (done.status, done.err) == (0, "")
    assert done.out.startswith("murmillo motions")
