"""Reading files, folders and datasets of any format: what is read, under which name and licence, what is left out."""

import pickle
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.formats.options import ReadOptions
from murmillo.envs.motion.formats.provenance import find_provenance
from murmillo.envs.motion.formats.reader import iter_files, read_file, read_recordings

BVH = """HIERARCHY
ROOT Hips
{ OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine { OFFSET 0 60 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 100 0 } } }
MOTION
Frames: 2
Frame Time: 0.0333333
0 90 0 0 0 0 0 0 0
1 90 0 0 0 0 0 0 0
"""


@pytest.fixture
def folder(tmp_path) -> Path:
    """Two sound files, of the same stem, and what else is found in folders of motions."""
    for place in ("a", "b"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "walk.bvh").write_text(BVH)
    (tmp_path / "README.txt").write_text("about it")
    (tmp_path / "video.mp4").write_bytes(b"")
    return tmp_path


def test_sound_files_are_read_and_the_others_listed(folder):
    (folder / "b" / "broken.bvh").write_text(BVH[:200])
    (folder / "lone.amc").write_text("1\nroot 0 0 0 0 0 0\n")
    recordings, problems = read_recordings(folder)
    assert [recording.name for recording in recordings] == ["a_walk_bvh", "b_walk_bvh"]
    assert len(problems) == 2
    assert "broken.bvh: " in problems[0]
    assert "lone.amc: has no skeleton beside it" in problems[1]


def test_names_with_blanks_and_other_letters(tmp_path):
    names = ["гладиатор идёт.bvh", "剣 と 盾.BVH", "pas de côté (1).bvh"]
    for name in names:
        (tmp_path / name).write_text(BVH)
    recordings, problems = read_recordings(tmp_path)
    assert problems == []
    assert {recording.name for recording in recordings} == {Path(name).stem for name in names}


def test_a_name_that_cannot_be_printed(tmp_path):
    file = tmp_path / "two\nlines.bvh"
    file.write_text(BVH)
    assert read_file(file).name == "two_lines"
    file.write_text("")
    with pytest.raises(MotionError) as caught:
        read_file(file)
    assert str(caught.value).isprintable()


def test_options_reach_the_reader(folder):
    recording = read_file(folder / "a" / "walk.bvh", ReadOptions(fps=60.0, unit="mm"))
    assert recording.fps == 60.0
    assert recording.findings["unit"] == "mm (told)"


def test_datasets_list_files_below_them_with_weights(folder):
    dataset = folder / "clips.yaml"
    dataset.write_text("motions:\n- {file: b/walk.bvh, weight: null}\n- {file: a/walk.bvh, weight: 2.5}\n")
    recordings, problems = read_recordings(dataset)
    assert problems == []
    assert [(recording.name, recording.weight) for recording in recordings] == [
        ("b_walk_bvh", 1.0),
        ("a_walk_bvh", 2.5),
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("motions: []", "lists no motions"),
        ("[", "is no YAML"),
        ("motions: [{file: ../walk.bvh}]", r"motions\[0\].file must be"),
        ("motions: [{file: /etc/walk.bvh}]", r"motions\[0\].file must be"),
        ("motions: [{file: a/walk.bvh}, {file: a/walk.bvh}]", r"motions\[1\].file is listed twice"),
        ("motions: [{file: a/walk.bvh, weight: -1}]", r"motions\[0\].weight must be a number above 0"),
        ("motions: [{file: a/walk.bvh, weight: true}]", r"motions\[0\].weight must be a number above 0"),
        (r'motions: [{file: "\0.bvh"}]', r"motions\[0\].file must be"),
        ('motions: !!int ""', "is no YAML"),  # over which PyYAML itself stumbles
        ("motions: !!bool maybe", "is no YAML"),
        ("#" * 2**21, "too large for a dataset"),
    ],
)
def test_datasets_that_are_wrong(folder, text, reason):
    (folder / "clips.yaml").write_text(text)
    with pytest.raises(MotionError, match=reason):
        read_recordings(folder / "clips.yaml")


def test_nothing_there(tmp_path):
    with pytest.raises(MotionError, match="there is no such file"):
        list(iter_files(tmp_path / "none"))
    with pytest.raises(MotionError, match=r"holds no motions; known are \.amc, \.bvh"):
        list(iter_files(tmp_path))
    (tmp_path / "clip.fbx").write_bytes(b"")
    with pytest.raises(MotionError, match=r"files of type \.fbx are unknown; known are"):
        read_file(tmp_path / "clip.fbx")
    (tmp_path / "02.asf").write_bytes(b"")
    with pytest.raises(MotionError, match="is a skeleton without motion"):
        read_file(tmp_path / "02.asf")
    (tmp_path / "folder.bvh").mkdir()
    with pytest.raises(MotionError, match="is no file"):
        read_file(tmp_path / "folder.bvh")


@pytest.mark.parametrize("suffix", [".amc", ".bvh", ".json", ".npy", ".npz", ".txt"])
def test_two_gigabytes_of_zeros(tmp_path, suffix):
    file = tmp_path / f"zeros{suffix}"
    with file.open("wb") as stream:
        stream.truncate(2**31)
    with pytest.raises(MotionError, match="is larger than 256 MB"):
        read_file(file)
    file.write_bytes(bytes(2**20))
    (tmp_path / "zeros.asf").write_bytes(bytes(2**10))
    with pytest.raises(MotionError, match="zeros"):
        read_file(file)


class _Spy:
    ran = False

    def __reduce__(self):
        return _run, ()


def _run():
    _Spy.ran = True


def test_code_in_a_file_is_named_and_not_run(tmp_path):
    np.save(tmp_path / "clip.npy", np.array(_Spy(), dtype=object), allow_pickle=True)
    np.savez(tmp_path / "clip.npz", poses=np.array(_Spy(), dtype=object))
    (tmp_path / "clip.json").write_bytes(pickle.dumps(_Spy()))
    recordings, problems = read_recordings(tmp_path)
    assert recordings == []
    assert len(problems) == 3
    assert any("which is code and no motion" in problem for problem in problems)
    assert not _Spy.ran


LICENCES = [
    ("LICENSE", "MIT License\n\nCopyright (c) 2018 Xue Bin Peng\n\nPermission is", "MIT", True),
    ("LICENSE.txt", "Attribution-NonCommercial 4.0 International\n... CC0 Public Domain ...", "CC-BY-NC-4.0", False),
    ("LICENSE", "Creative Commons Attribution-NonCommercial-NoDerivatives 4.0 International", "CC-BY-NC-ND-4.0", False),
    ("README.md", "These are CC BY 4.0, enjoy.", "CC-BY-4.0", True),
    ("README.md", "These are CC BY-SA 4.0.", "CC-BY-SA-4.0", False),
    ("README.md", "CC BY-NC-ND 4.0, the code is under the MIT License", "unknown", False),
    ("readme.txt", "CC0", "CC0-1.0", True),
    ("COPYING", "Apache License\n   Version 2.0, January 2004", "Apache-2.0", True),
    ("LICENSE", "All rights reserved. You may not submit this.", "unknown", False),
    ("notes.txt", "MIT License", "unknown", False),
    ("README.md", "Motions: CC-BY-NC-4.0. Code: MIT License.", "unknown", False),
    ("README.md", "CC-BY-NC-SA-4.0", "CC-BY-NC-SA-4.0", False),
    ("LICENSE", "MIT License ... The motions are for non-commercial use.", "unknown", False),
    ("README.md", "MIT License, but data for research purposes only", "unknown", False),
]


@pytest.mark.parametrize(("name", "text", "licence", "redistributable"), LICENCES)
def test_licences_that_cannot_be_misread(tmp_path, name, text, licence, redistributable):
    (tmp_path / name).write_text(text)
    found = find_provenance(tmp_path)
    assert (found.licence, found.redistributable) == (licence, redistributable)
    if licence == "MIT":
        assert found.source == "Copyright (c) 2018 Xue Bin Peng"


def test_a_read_me_does_not_overrule_a_licence_that_is_not_known(tmp_path):
    (tmp_path / "LICENSE").write_text("All rights reserved.")
    (tmp_path / "README.md").write_text("Made with a tool under the MIT License")
    assert find_provenance(tmp_path).licence == "unknown"


def test_a_listed_file_whose_name_no_file_can_have(folder):
    (folder / "clips.yaml").write_text(f"motions: [{{file: {'x' * 300}.bvh}}, {{file: a/walk.bvh}}]")
    recordings, problems = read_recordings(folder / "clips.yaml")
    assert [recording.name for recording in recordings] == ["walk"]
    assert len(problems) == 1
    assert "is no file" in problems[0]


def test_a_recording_has_the_licence_of_its_folder(folder):
    (folder / "a" / "LICENSE").write_text("CC0 1.0 Universal")
    recording = read_file(folder / "a" / "walk.bvh")
    assert (recording.source, recording.licence, recording.redistributable) == ("a", "CC0-1.0", True)
    assert read_file(folder / "b" / "walk.bvh").licence == "unknown"


# the recordings beside the repository


def test_every_kind_of_recording_there_is_read(shared_motions, tmp_path):
    """All of the small ones, every sixth of ASE's, every tenth of Bandai Namco's, and what is found out about them."""
    files = [listed.path for listed in iter_files(shared_motions)]
    count = Counter(file.suffix for file in files)
    assert count == {".npy": 90, ".json": 29, ".txt": 15, ".bvh": 174, ".amc": 6}
    small = [file for file in files if file.stat().st_size < 10**6 and file.suffix not in (".bvh", ".npy")]
    amp = [file for file in files if file.stem.startswith("amp_humanoid")]
    bvh = [file for file in files if file.suffix == ".bvh"][::10]
    npy = [file for file in files if file.suffix == ".npy"][::6]
    for file in [*small, *amp, *bvh, *npy]:
        recording = read_file(file)
        assert recording.findings["left, right"] == "as named (measured)", file
        assert recording.findings["rest frame"] == "none", file
        assert 1.3 < float(recording.findings["height"].split()[0]) < 1.6, file
        pos, quat = recording.global_pose()
        assert np.isfinite(pos).all(), file
        np.testing.assert_allclose(np.linalg.norm(quat, axis=-1), 1.0, atol=1e-9)
        np.testing.assert_allclose(np.median(pos[..., 2].min(axis=1)), 0.04, atol=0.2, err_msg=str(file))
    assert {len(read_file(file).skeleton.names) for file in amp} == {15}
    licences = {file.suffix: read_file(file).licence for file in [bvh[0], npy[-1], small[0], small[-1]]}
    assert licences[".bvh"] == "CC-BY-NC-4.0"
    assert licences[".npy"] == "Reallusion, noncommercial"


def test_adaptnets_dataset_is_a_dataset(shared_motions):
    listed = list(iter_files(shared_motions / "walk_run_lafan1" / "clips_crouch.yaml"))
    assert [file.weight for file in listed] == [None] * 4
    assert all(file.path.is_file() for file in listed)


def test_an_amc_without_its_asf(shared_motions, tmp_path):
    shutil.copy(shared_motions / "cmu_asf_amc" / "02_03.amc", tmp_path)
    with pytest.raises(MotionError, match=r"02_03\.amc: has no skeleton beside it"):
        read_file(tmp_path / "02_03.amc")
