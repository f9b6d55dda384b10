import json
import math
import sys
from pathlib import Path

import pytest
import torch

from murmillo.agents.common import checkpoint
from murmillo.agents.common.errors import AgentError
from tests.agents.toy import equal

STATE = {
    "agent": {
        "weights": {"0.weight": torch.arange(6.0).reshape(2, 3), "mean": torch.tensor(1.5, dtype=torch.float64)},
        "flags": torch.tensor([True, False]),
        "empty": {},
    },
    "generator": torch.Generator().manual_seed(3).get_state(),
    "none": torch.zeros(0, 4),
    "meta": {"character": "toy", "skills": ["walk", "kick"], "dims": [4, 2]},
    "samples": 2**40,
    "rate": 0.1,
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    checkpoint.save(tmp_path / "last", STATE)
    return tmp_path / "last"


def test_round_trip(folder: Path) -> None:
    assert equal(checkpoint.load(folder), STATE)
    assert sorted(path.name for path in folder.parent.iterdir()) == ["last"]


def test_views_and_shared_memory_are_saved_as_they_look(tmp_path: Path) -> None:
    base = torch.arange(12.0).reshape(3, 4)
    checkpoint.save(tmp_path / "c", {"a": base, "b": base.T, "c": base[1:]})
    assert equal(checkpoint.load(tmp_path / "c"), {"a": base, "b": base.T, "c": base[1:]})


def test_a_second_save_replaces_the_first(folder: Path) -> None:
    checkpoint.save(folder, {"samples": 1})
    assert checkpoint.load(folder) == {"samples": 1}


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-3] ^= 1
    path.write_bytes(content)


def foreign(path: Path) -> None:
    path.write_text(json.dumps({"weights": [1, 2]}))


def newer(path: Path) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), "version": 99}))


@pytest.mark.parametrize("name", [checkpoint.TENSORS, checkpoint.META])
@pytest.mark.parametrize("damage", [truncate, foreign, Path.unlink])
def test_damage_is_one_line(folder: Path, name: str, damage: object) -> None:
    damage(folder / name)  # type: ignore[operator]
    with pytest.raises(AgentError) as error:
        checkpoint.load(folder)
    assert name in str(error.value)
    assert "\n" not in str(error.value)


def test_a_single_altered_bit_is_noticed(folder: Path) -> None:
    flip(folder / checkpoint.TENSORS)
    with pytest.raises(AgentError, match="damaged"):
        checkpoint.load(folder)


def test_another_version_and_a_missing_folder(folder: Path) -> None:
    newer(folder / checkpoint.META)
    with pytest.raises(AgentError, match="version 99"):
        checkpoint.load(folder)
    with pytest.raises(AgentError, match="nowhere"):
        checkpoint.load(folder.parent / "nowhere")


def test_a_failed_save_leaves_the_last_good_one(folder: Path) -> None:
    with pytest.raises(TypeError, match="agent/bad"):
        checkpoint.save(folder, {"agent": {"bad": object()}})
    assert equal(checkpoint.load(folder), STATE)


@pytest.mark.parametrize("crash_at", [1, 2])
def test_a_crash_between_the_renames_loses_nothing(
    folder: Path, crash_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace, calls = checkpoint.os.replace, []

    def crash(source: Path, target: Path) -> None:
        calls.append(source)
        if len(calls) == crash_at:
            raise KeyboardInterrupt
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(checkpoint.os, "replace", crash)
        with pytest.raises(KeyboardInterrupt):
            checkpoint.save(folder, {"samples": 1})
    assert equal(checkpoint.load(folder), STATE)
    checkpoint.save(folder, {"samples": 2})
    assert checkpoint.load(folder) == {"samples": 2}
    assert sorted(path.name for path in folder.parent.iterdir()) == ["last"]


def test_nothing_is_unpickled(folder: Path) -> None:
    unpickled = []
    watching = True
    sys.addaudithook(lambda event, _: unpickled.append(event) if watching and event.startswith("pickle") else None)
    checkpoint.load(folder)
    watching = False
    assert unpickled == []


def test_what_does_not_fit_is_told_in_one_line() -> None:
    meta = {"character": "sword_shield", "state_dim": 120, "skills": ["walk"]}
    checkpoint.check_compatible(meta, {"character": "sword_shield"})
    with pytest.raises(AgentError) as error:
        checkpoint.check_compatible(meta, {"character": "other", "state_dim": 120, "action_dim": 31})
    assert str(error.value).endswith(
        "character is 'sword_shield' there, 'other' here; action_dim is None there, 31 here"
    )


def test_keys_that_cannot_be_paths_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="without '/'"):
        checkpoint.save(tmp_path / "c", {"a/b": math.pi})


def test_a_long_list_that_differs_is_told_by_its_ends() -> None:
    there, here = [f"skill{i}" for i in range(87)], ["walk", "run"]
    with pytest.raises(AgentError, match=r"skills is 87 from 'skill0' to 'skill86' there, \['walk', 'run'\] here"):
        checkpoint.check_compatible({"skills": there}, {"skills": here})
