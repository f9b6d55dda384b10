"""Clips to test with: small ones made here, and the recordings beside the repository where there are any."""

import io
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import MotionError
from murmillo.envs.motion import Clip

SHARED = Path(__file__).parents[4] / "shared" / "motions"
RECORDINGS = SHARED / "sword_shield_ase"


@pytest.fixture(scope="session")
def character() -> Character:
    return load_character()


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of ASE's 87 clips."""
    if not RECORDINGS.is_dir():
        pytest.skip("needs the clips of ASE in ../shared/motions/sword_shield_ase")
    return RECORDINGS


@pytest.fixture(scope="session")
def shared_motions() -> Path:
    """The folder of recordings in many formats."""
    if not SHARED.is_dir():
        pytest.skip("needs the recordings in ../shared/motions")
    return SHARED


@pytest.fixture(scope="session")
def refuses() -> Callable[[Callable[[], Any], str, str], None]:
    """Check that reading is refused in one line that begins with the place and holds the reason, a regex."""

    def check(read: Callable[[], Any], reason: str, place: str) -> None:
        with pytest.raises(MotionError, match=reason) as caught:
            read()
        assert str(caught.value).startswith(place)
        assert "\n" not in str(caught.value)

    return check


def random_qpos(character: Character, frames: int, seed: int) -> np.ndarray:
    """Poses [frames, nq] that drift at random: unit quaternions, neighbours within about half a radian."""
    rng = np.random.default_rng(seed)
    qpos = character.model.qpos0 + 0.1 * rng.standard_normal((frames, character.model.nq)).cumsum(axis=0)
    for columns in [slice(3, 7), *(joint.qpos for joint in character.joints if joint.kind == "ball")]:
        qpos[:, columns] /= np.linalg.norm(qpos[:, columns], axis=1, keepdims=True)
    return qpos


@pytest.fixture(scope="session")
def make_clip(character: Character) -> Callable[..., Clip]:
    """A synthetic clip; keywords replace the fields of `Clip`."""

    def make(name: str = "drift", frames: int = 20, seed: int = 0, **fields: Any) -> Clip:
        defaults = {
            "fps": 30.0,
            "qpos": random_qpos(character, frames, seed),
            "label": name,
            "source": "made in a test",
            "licence": "CC0-1.0",
            "redistributable": True,
        }
        return Clip(name=name, character=character.name, **(defaults | fields))

    return make


@pytest.fixture
def poselib_motion(character: Character) -> dict[str, Any]:
    """What a poselib file holds: 5 frames; in each the right elbow bends by -0.1 rad and the torso turns by 0.2."""
    model = character.model
    rotation = np.zeros((5, len(character.bodies), 4))
    rotation[..., 3] = 1.0
    bend, turn = -0.1 * np.arange(5), 0.2 * np.arange(5)
    elbow, torso = character.bodies.index("right_lower_arm"), character.bodies.index("torso")
    rotation[:, elbow, 1], rotation[:, elbow, 3] = np.sin(bend / 2), np.cos(bend / 2)
    rotation[:, torso, 2], rotation[:, torso, 3] = np.sin(turn / 2), np.cos(turn / 2)
    translation = np.tile([1.0, 2.0, 0.9], (5, 1))
    return OrderedDict(
        rotation={"arr": rotation, "context": {"dtype": "float64"}},
        root_translation={"arr": translation, "context": {"dtype": "float64"}},
        skeleton_tree=OrderedDict(
            node_names=list(character.bodies),
            parent_indices={"arr": model.body_parentid[1:].astype(np.int64) - 1, "context": {"dtype": "int64"}},
            local_translation={"arr": model.body_pos[1:].astype(np.float32), "context": {"dtype": "float32"}},
        ),
        is_local=True,
        fps=np.float64(29.9),
        __name__="SkeletonMotion",
    )


@pytest.fixture(scope="session")
def npy_of() -> Callable[[bytes], bytes]:
    """A .npy file around a pickle."""

    def wrap(pickled: bytes) -> bytes:
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "|O", "fortran_order": False, "shape": ()})
        return header.getvalue() + pickled

    return wrap


@pytest.fixture(scope="session")
def save_poselib() -> Callable[[Any], bytes]:
    """The bytes that numpy.save writes for a poselib motion."""

    def save(motion: Any) -> bytes:
        file = io.BytesIO()
        np.save(file, np.array(motion, dtype=object), allow_pickle=True)
        return file.getvalue()

    return save
