"""Folders and files of clips: the native format bit for bit, datasets with weights, and what can be wrong with them."""

import hashlib
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from murmillo.envs.errors import MotionError
from murmillo.envs.motion import load_clips, save_clips


@pytest.fixture
def pack(tmp_path, make_clip) -> Path:
    folder = tmp_path / "pack"
    save_clips(
        folder,
        [
            make_clip("walk", seed=1, weight=0.1, loop=True, masked=("sword",)),
            make_clip("Kick (left)", seed=2, fps=29.857397),
        ],
    )
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def edit_manifest(folder: Path, edit) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    edit(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def test_round_trip_is_exact_to_the_bit(pack, character, make_clip):
    loaded = load_clips(pack, character)
    save_clips(pack.parent / "again", loaded)
    for clip, again in zip(loaded, load_clips(pack.parent / "again", character), strict=True):
        assert clip.qpos.tobytes() == again.qpos.tobytes()
        for field in (
            "name",
            "character",
            "fps",
            "label",
            "source",
            "licence",
            "redistributable",
            "weight",
            "loop",
            "masked",
        ):
            assert getattr(clip, field) == getattr(again, field)
    assert [clip.name for clip in loaded] == ["walk", "Kick (left)"]
    np.testing.assert_allclose(np.abs(loaded[0].qpos), np.abs(make_clip(seed=1).qpos), atol=1e-15)


def test_the_same_clips_give_the_same_bytes(pack, character):
    before = contents(pack)
    save_clips(pack, load_clips(pack, character))
    once = contents(pack)
    save_clips(pack, load_clips(pack, character))
    assert contents(pack) == once
    assert set(once) == set(before) == {"manifest.json", "walk.npz", "Kick_(left).npz"}


def test_numpy_reads_the_arrays_without_pickle(pack):
    with np.load(pack / "walk.npz", allow_pickle=False) as file:
        assert file["qpos"].shape == (20, 47)


def test_one_clip_of_a_folder(pack, character):
    assert [clip.name for clip in load_clips(pack / "walk.npz", character)] == ["walk"]
    (pack / "other.npz").write_bytes((pack / "walk.npz").read_bytes())
    with pytest.raises(MotionError, match=r"does not list other\.npz"):
        load_clips(pack / "other.npz", character)


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda m: m.update(format="murmillo-clips/9"), "format murmillo-clips/1"),
        (lambda m: m.update(character="dragon"), "are for 'dragon', not sword_shield"),
        (lambda m: m.update(clips=[]), "needs a character and a list of clips"),
        (lambda m: m["clips"].append(3), "clip 2 has missing, unknown or wrong fields: 'all'"),
        (lambda m: m["clips"][1].pop("fps"), "clip 1 has missing, unknown or wrong fields: 'fps'"),
        (lambda m: m["clips"][0].update(fps=0), "wrong fields: 'fps'"),
        (lambda m: m["clips"][0].update(fps=True), "wrong fields: 'fps'"),
        (lambda m: m["clips"][0].update(weight=10**400), "wrong fields: 'weight'"),
        (lambda m: m["clips"][0].update(masked="sword"), "wrong fields: 'masked'"),
        (lambda m: m["clips"][0].update(masked=[1]), "wrong fields: 'masked'"),
        (lambda m: m["clips"][0].update(masked=3), "wrong fields: 'masked'"),
        (lambda m: m["clips"][0].update(speed=1.0), "wrong fields: 'speed'"),
        (lambda m: m["clips"][0].update(file="../walk.npz"), "plain name"),
        (lambda m: m["clips"][0].update(file="absent.npz"), "absent.npz: cannot be read"),
        (lambda m: m["clips"][0].update(sha256="0" * 64), "sha256 differs"),
        (lambda m: m["clips"][0].update(frames=19), "the manifest says 19 frames"),
        (lambda m: m["clips"][0].update(name="two\nlines"), "printable"),
    ],
)
def test_a_bad_manifest_is_refused(pack, character, edit, reason):
    edit_manifest(pack, edit)
    with pytest.raises(MotionError, match=reason) as caught:
        load_clips(pack, character)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": NaN}', "[" * 100_000, "\xff"])
def test_a_manifest_that_is_no_json_is_refused(pack, character, text):
    (pack / "manifest.json").write_text(text, encoding="latin1")
    with pytest.raises(MotionError, match=r"manifest\.json: is no"):
        load_clips(pack, character)


def test_truncated_clips_are_refused(pack, character):
    whole = (pack / "walk.npz").read_bytes()
    for part in range(20):
        (pack / "walk.npz").write_bytes(whole[: len(whole) * part // 20])
        with pytest.raises(MotionError, match=r"walk\.npz: is not the file that the manifest lists"):
            load_clips(pack, character)


def put(folder: Path, data: bytes) -> None:
    """Replace a clip, and its sum in the manifest."""
    (folder / "walk.npz").write_bytes(data)
    edit_manifest(folder, lambda m: m["clips"][0].update(sha256=hashlib.sha256(data).hexdigest()))


def zipped(name: str, content: bytes, compression: int = zipfile.ZIP_STORED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        archive.writestr(name, content)
    return file.getvalue()


def saved(array: np.ndarray, **options) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def nothing_of_shape(shape: str) -> bytes:
    """The header of an array without its numbers."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"PK", "is no .npz"),
        (zipped("other.npy", b""), "is no .npz with an array qpos"),
        (zipped("qpos.npy", bytes(2**20), zipfile.ZIP_DEFLATED), "compressed"),
        (zipped("qpos.npy", b"junk"), "is no .npy file"),
        (zipped("qpos.npy", saved(np.zeros((20, 47), dtype=np.float32))), "type <f4"),
        (zipped("qpos.npy", saved(np.zeros((47, 20)).T)), "Fortran"),
        (zipped("qpos.npy", saved(np.zeros((20, 47)))[:-8]), "do not make the shape"),
        (zipped("qpos.npy", saved(np.zeros((20, 47))).replace(b"(20, 47)", b"(20,999)")), "do not make the shape"),
        (zipped("qpos.npy", nothing_of_shape("(0, 999999999999, 999999999999)")), "0 bytes do not make the shape"),
        (zipped("qpos.npy", saved(np.array([object], dtype=object), allow_pickle=True)), r"type \|O"),
        (zipped("qpos.npy", saved(np.zeros((20, 47)))), "root: its quaternion has norm 0"),
        (zipped("qpos.npy", saved(np.full((20, 47), np.nan))), "clip walk: frame 0 of 20 has a NaN"),
    ],
)
def test_a_bad_clip_with_a_right_sum_is_refused(pack, character, data, reason):
    put(pack, data)
    with pytest.raises(MotionError, match=reason):
        load_clips(pack, character)


@settings(
    max_examples=200, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(edits=st.lists(st.tuples(st.integers(0, 400), st.booleans(), st.binary(max_size=3)), min_size=1, max_size=6))
def test_damaged_clips_give_a_clip_or_one_line(pack, character, edits):
    data = (pack / "Kick_(left).npz").read_bytes()
    for place, from_end, replacement in edits:
        at = max(len(data) - 1 - place, 0) if from_end else place
        data = data[:at] + replacement + data[at + 1 :]
    put(pack, data)
    try:
        load_clips(pack, character)
    except MotionError as error:
        message = str(error)
        assert "\n" not in message


def test_a_failing_save_leaves_everything_as_it_was(pack, make_clip):
    before = contents(pack)
    too_long = make_clip("x" * 300)  # the second file cannot be written, the first has been
    with pytest.raises(MotionError, match="cannot be written"):
        save_clips(pack, [make_clip("fine"), too_long])
    assert contents(pack) == before
    with pytest.raises(MotionError, match="cannot be written"):
        save_clips(pack.parent / "new", [make_clip("fine"), too_long])
    assert [entry.name for entry in pack.parent.iterdir()] == ["pack"]


def test_a_save_replaces_older_clips_and_nothing_else(pack, make_clip, character):
    save_clips(pack, [make_clip("only")])
    assert [clip.name for clip in load_clips(pack, character)] == ["only"]
    assert set(contents(pack)) == {"manifest.json", "only.npz"}
    (pack / "notes.txt").write_text("mine")
    with pytest.raises(MotionError, match="holds other files"):
        save_clips(pack, [make_clip("other")])
    assert set(contents(pack)) == {"manifest.json", "only.npz", "notes.txt"}


def test_a_recording_beside_saved_clips_is_not_lost(pack, make_clip):
    (pack / "recording.npz").write_bytes(b"the only copy")
    before = contents(pack)
    with pytest.raises(MotionError, match="holds other files"):
        save_clips(pack, [make_clip("other")])
    assert contents(pack) == before


def test_what_cannot_be_saved(tmp_path, make_clip):
    clip = make_clip("walk")
    (tmp_path / "file").write_text("")
    for folder, clips, reason in [
        ("a", [], "no clips to save"),
        ("b", [clip, make_clip("Walk")], "two clips would be the file"),
        ("c", [clip, type(clip)(**{**vars(clip), "character": "dragon", "name": "fly"})], "several characters"),
        ("file", [clip], "cannot be written"),
        ("file/below", [clip], "cannot be written"),
    ]:
        with pytest.raises(MotionError, match=reason):
            save_clips(tmp_path / folder, clips)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


@pytest.fixture
def poselib_folder(tmp_path, poselib_motion, save_poselib) -> Path:
    for name in ("one.npy", "two.npy"):
        (tmp_path / name).write_bytes(save_poselib(poselib_motion))
    return tmp_path


def test_a_folder_without_a_dataset_gives_all_its_clips(poselib_folder, character):
    clips = load_clips(str(poselib_folder), character)
    assert [(clip.name, clip.weight, clip.licence) for clip in clips] == [
        ("one", 1.0, "unknown"),
        ("two", 1.0, "unknown"),
    ]


def test_a_dataset_chooses_and_weighs(poselib_folder, character):
    (poselib_folder / "amp.npy").write_bytes(b"another character's")
    (poselib_folder / "set.yaml").write_text(
        "motions:\n - {file: two.npy, weight: 0.25}\n - {file: one.npy, weight: 3}\n"
    )
    assert [(clip.name, clip.weight) for clip in load_clips(poselib_folder, character)] == [("two", 0.25), ("one", 3.0)]


def test_of_several_datasets_the_complete_one_is_taken(poselib_folder, character):
    (poselib_folder / "full.yaml").write_text("motions: [{file: absent.npy, weight: 1}]")
    with pytest.raises(MotionError, match=r"full\.yaml: lists 'absent\.npy', which is not in the folder"):
        load_clips(poselib_folder, character)
    (poselib_folder / "part.yaml").write_text("motions: [{file: two.npy, weight: 1}]")
    assert [clip.name for clip in load_clips(poselib_folder, character)] == ["two"]
    (poselib_folder / "other.yaml").write_text("motions: [{file: one.npy, weight: 1}]")
    with pytest.raises(MotionError, match=r"several datasets \(other\.yaml, part\.yaml\); give the path of one"):
        load_clips(poselib_folder, character)
    assert [clip.name for clip in load_clips(poselib_folder / "other.yaml", character)] == ["one"]


@pytest.mark.parametrize(
    "text",
    [
        "motions: [",
        "- a",
        "motions: []",
        "motions: [one.npy]",
        "motions: [{file: ../one.npy, weight: 1}]",
        "motions: [{file: one.npy}]",
        "motions: [{file: one.npy, weight: 0}]",
        "motions: [{file: one.npy, weight: .nan}]",
        "motions: [{file: one.npy, weight: 1}, {file: one.npy, weight: 1}]",
        "!!python/object/apply:os.system ['touch marker']",
        "motions: [{file: one.npy, weight: true}]",
        'motions: [{file: "\\0.npy", weight: 1}]',
        'motions: !!int ""',
        "\x00",
    ],
)
def test_a_bad_dataset_is_refused(poselib_folder, character, text):
    (poselib_folder / "set.yaml").write_text(text)
    with pytest.raises(MotionError, match=r"set\.yaml: ") as caught:
        load_clips(poselib_folder, character)
    assert "\n" not in str(caught.value)


def test_a_dataset_of_other_clips_names_the_importer(poselib_folder, character):
    """AdaptNet's own lists, whose weights are null, are JSON files: what they lack is no weight."""
    (poselib_folder / "walk.yaml").write_text("motions: [{file: one.npy, weight: 1}, {file: walk.json, weight: null}]")
    with pytest.raises(MotionError, match=r"lists 'walk\.json', which is no \.npy clip; ") as caught:
        load_clips(poselib_folder / "walk.yaml", character)
    assert f"import {poselib_folder / 'walk.yaml'} --to FOLDER --character {character.name}`" in str(caught.value)


def test_paths_without_clips(tmp_path, character):
    (tmp_path / "empty").mkdir()
    (tmp_path / "walk.bvh").write_text("HIERARCHY")
    for path, reason in [
        ("absent", "no such file or folder"),
        ("empty", "neither manifest.json nor .npy"),
        ("walk.bvh", "type .bvh are unknown"),
        ("x" * 5000, "no such file or folder"),
    ]:
        with pytest.raises(MotionError, match=reason):
            load_clips(tmp_path / path, character)


def test_a_manifest_from_before_clips_could_be_masked_is_read(pack, character):
    edit_manifest(pack, lambda m: [clip.pop("masked") for clip in m["clips"]])
    assert [clip.masked for clip in load_clips(pack, character)] == [(), ()]


def test_clips_are_chosen_by_name_and_pattern(pack, character):
    every = [clip.name for clip in load_clips(pack, character)]
    assert [clip.name for clip in load_clips(pack, character, (every[-1], every[0]))] == [every[0], every[-1]]
    assert [clip.name for clip in load_clips(pack, character, ("*",))] == every


def test_a_name_that_no_clip_has_is_refused_with_the_nearest(pack, character):
    first = load_clips(pack, character)[0].name
    with pytest.raises(MotionError, match=f"clips={first}x: .* did you mean {first}"):
        load_clips(pack, character, (f"{first}x",))
    with pytest.raises(MotionError, match=r"clips=§: .* there are: "):
        load_clips(pack, character, (first, "§"))
