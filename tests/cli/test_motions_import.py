"""`murmillo motions import`, from files to clips that can be trained on."""

import hashlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.character import load_character
from murmillo.envs.motion import Clip, load_clips, save_clips
from murmillo.envs.motion.ground import ground_of
from tests.cli.conftest import Done
from tests.cli.motion_files import amass, bvh

pytest.importorskip("mink", reason="retargeting needs the motion extra: pip install murmillo[motion]")

Murmillo = Callable[..., Done]
CHARACTER = load_character("sword_shield")


def loaded(path: str | Path, character: str = "sword_shield") -> dict[str, Clip]:
    return {clip.name: clip for clip in load_clips(path, load_character(character))}


@pytest.fixture
def recordings(folder: Path) -> Path:
    """Two sound files of different formats, and one that is damaged."""
    place = folder / "recordings"
    place.mkdir()
    (place / "squat_slow_01.bvh").write_text(bvh())
    np.savez(place / "stand_still_01.npz", **amass())
    (place / "torn.bvh").write_text(bvh()[:900])
    return place


def test_sound_files_are_imported_and_the_others_listed(murmillo: Murmillo, recordings: Path) -> None:
    done = murmillo("motions", "import", "recordings", "--to", "clips", "--jobs", "1", "--report", "import.md")
    assert done.status == 0, done.err
    assert done.err.count("\n") == 1
    assert done.err.startswith("murmillo: not imported: recordings/torn.bvh: ")
    clips = loaded("clips")
    assert list(clips) == ["squat_slow_01", "stand_still_01"]
    squat = clips["squat_slow_01"]
    assert squat.origin == hashlib.sha256((recordings / "squat_slow_01.bvh").read_bytes()).hexdigest()
    assert squat.masked == ("sword", "shield")
    assert not squat.redistributable  # nobody said that it is
    assert "2 clips, " in done.out
    assert "Mixamo" in done.out
    assert "SMPL" in done.out
    report = Path("import.md").read_text()
    assert "| squat_slow_01 | Mixamo |" in report
    assert "torn.bvh" in report


def test_the_clip_does_what_the_recording_did(murmillo: Murmillo, recordings: Path) -> None:
    """Knees bend by 80 degrees in the middle and the pelvis sinks; the feet stay flat where they stand."""
    assert murmillo("motions", "import", "recordings/squat_slow_01.bvh", "--to", "clips", "--jobs", "1").status == 0
    clip = loaded("clips")["squat_slow_01"]
    knee = next(joint for joint in CHARACTER.joints if joint.name == "left_knee")
    middle = clip.frames // 2
    assert np.degrees(clip.qpos[middle, knee.qpos][0] - clip.qpos[0, knee.qpos][0]) == pytest.approx(80.0, abs=12.0)
    assert clip.qpos[middle, 2] < clip.qpos[0, 2] - 0.15
    ground = ground_of(clip, CHARACTER)
    assert ground.slide.max() < 0.01
    assert ground.height.min() > -0.01


def test_labels_terms_and_the_other_character(murmillo: Murmillo, recordings: Path) -> None:
    words = ("--character", "humanoid", "--labels", "from-name", "--rule", "content", "--licence", "CC0-1.0")
    told = ("--source", "a test", "--redistributable", "--jobs", "1")
    done = murmillo("motions", "import", "recordings/squat_slow_01.bvh", "--to", "clips", *words, *told)
    assert done.status == 0, done.err
    clip = loaded("clips", "humanoid")["squat_slow_01"]
    assert (clip.label, clip.source, clip.licence, clip.redistributable) == ("squat", "a test", "CC0-1.0", True)
    assert clip.masked == ()
    listed = murmillo("motions", "list", "clips")  # the manifest says whose they are
    assert "for humanoid" in listed.out


def test_a_clip_without_a_label_is_not_imported(murmillo: Murmillo, recordings: Path) -> None:
    Path("labels.json").write_text('{"squat_slow_01": "squat"}')
    done = murmillo("motions", "import", "recordings", "--to", "clips", "--labels", "labels.json", "--jobs", "1")
    assert done.status == 0
    assert {name: clip.label for name, clip in loaded("clips").items()} == {"squat_slow_01": "squat"}
    assert "labels.json: has no label for the clip stand_still_01" in done.err


def test_adding_and_replacing(murmillo: Murmillo, recordings: Path) -> None:
    guard = next(clip for clip in load_clips("builtin", CHARACTER) if clip.name == "guard")
    save_clips("clips", [guard])
    words = ("motions", "import", "recordings/squat_slow_01.bvh", "--to", "clips", "--jobs", "1")
    refused = murmillo(*words)
    assert (refused.status, refused.err.count("\n")) == (2, 1)
    assert murmillo(*words, "--add").status == 0
    assert list(loaded("clips")) == ["guard", "squat_slow_01"]
    assert murmillo(*words, "--add").status == 0  # the same file again takes its own place
    assert list(loaded("clips")) == ["guard", "squat_slow_01"]
    assert murmillo(*words, "--replace").status == 0
    assert list(loaded("clips")) == ["squat_slow_01"]


def test_saved_clips_are_joined_without_conversion(murmillo: Murmillo, recordings: Path) -> None:
    save_clips("pack", load_clips("builtin", CHARACTER)[:2])
    done = murmillo("motions", "import", "pack", "recordings/squat_slow_01.bvh", "--to", "mix", "--jobs", "1")
    assert done.status == 0, done.err
    mixed, pack = loaded("mix"), loaded("pack")
    assert list(mixed) == [*pack, "squat_slow_01"]
    for name, clip in pack.items():
        assert mixed[name].qpos.tobytes() == clip.qpos.tobytes()


def test_names_with_spaces_and_foreign_letters(murmillo: Murmillo, folder: Path) -> None:
    for name in ("歩く 01", "走る 01"):
        (folder / f"{name}.bvh").write_text(bvh(4))
    done = murmillo("motions", "import", ".", "--to", "clips", "--labels", "from-name", "--jobs", "1")
    assert done.status == 0, done.err
    assert {clip.name: clip.label for clip in loaded("clips").values()} == {"歩く 01": "歩く", "走る 01": "走る"}


def test_in_several_processes(murmillo: Murmillo, recordings: Path) -> None:
    one = murmillo("motions", "import", "recordings", "--to", "out_a", "--jobs", "1")
    two = murmillo("motions", "import", "recordings", "--to", "out_b", "--jobs", "2")
    assert (one.status, two.status) == (0, 0), two.err
    assert one.out.replace("out_a", "") == two.out.replace("out_b", "")
    for name, clip in loaded("out_a").items():
        assert loaded("out_b")[name].qpos.tobytes() == clip.qpos.tobytes()


def test_training_on_imported_clips_keeps_their_terms(
    murmillo: Murmillo, recordings: Path, tiny: tuple[str, ...]
) -> None:
    save_clips("pack", load_clips("builtin", CHARACTER)[:1])
    words = ("pack", "recordings/squat_slow_01.bvh", "--licence", "CC-BY-NC-4.0", "--jobs", "1")
    assert murmillo("motions", "import", *words, "--to", "mix").status == 0
    done = murmillo("train", *tiny, "motions=mix", "run.name=mixed")
    assert done.status == 0, done.err
    meta = json.loads(Path("runs/mixed/checkpoints/last/meta.json").read_text())["values"]
    assert meta["meta/terms/licences"] == ["CC-BY-NC-4.0", "CC0-1.0"]
    assert meta["meta/terms/redistributable"] is False
    assert "weights trained on them, may not be passed on freely" in Path("runs/mixed/report.md").read_text()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for one process")
def test_broken_off_nothing_is_left(folder: Path) -> None:
    for index in range(200):
        (folder / f"{index}.bvh").write_text(bvh(60))
    words = ["motions", "import", str(folder), "--to", str(folder / "clips"), "--jobs", "1"]
    code = "import sys; from murmillo.cli.main import main; print('up', flush=True); sys.exit(main(sys.argv[1:]))"
    process = subprocess.Popen([sys.executable, "-c", code, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err.decode() == "murmillo: broken off\n"
    assert all(path.suffix == ".bvh" for path in folder.iterdir())
