"""Starts one by one: what each kind of episode begins with."""

import pytest
import torch

from murmillo.envs import starts
from murmillo.envs.bodies import BodyConfig, load_body
from murmillo.envs.character import Character, load_character
from murmillo.envs.geometry import lowest_point
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.physics.cpu import CpuPhysics
from murmillo.envs.scene import Scene
from murmillo.envs.starts import DEFAULT, FALLEN, RECOVERY, REFERENCE, StartConfig, StartSampler


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


@pytest.fixture(scope="module")
def library(character: Character) -> MotionLibrary:
    return MotionLibrary(load_clips("builtin", character), character)


def test_a_reference_start_is_the_clips_pose_and_velocity_and_not_in_the_floor(
    character: Character, library: MotionLibrary, generator: torch.Generator
) -> None:
    deep = MotionLibrary(library.clips, character)
    deep._qpos[:, 2] -= 0.02  # every clip stands in the floor
    sample, moments = deep.sample, []
    deep.sample = lambda *args: moments.append(sample(*args)) or moments[-1]  # type: ignore[method-assign]
    starts = StartSampler(character, deep, StartConfig(), 50, frames=4).draw(
        torch.arange(50), torch.zeros(50, dtype=torch.bool), generator, REFERENCE
    )
    [(clip, time)] = moments
    qpos, qvel = deep.pose(clip, time)
    assert torch.equal(starts.frames, deep.frames(clip, time, 4))
    columns = [i for i in range(qpos.shape[1]) if i != 2]
    torch.testing.assert_close(starts.qpos[:, columns], qpos[:, columns].double())
    torch.testing.assert_close(starts.qvel, qvel.double())
    assert lowest_point(character, starts.qpos).min() > -1e-5
    assert (starts.qpos[:, 2] >= qpos[:, 2]).all()


def test_starts_know_the_labels_of_their_clips(
    character: Character, library: MotionLibrary, generator: torch.Generator
) -> None:
    sample, moments = library.sample, []
    library.sample = lambda *args: moments.append(sample(*args)) or moments[-1]  # type: ignore[method-assign]
    starts = StartSampler(character, library, StartConfig(reference=0.5, fallen=0.0, commanded=0.25), 400, 1).draw(
        torch.arange(400), torch.zeros(400, dtype=torch.bool), generator
    )
    begun = int((starts.kind == REFERENCE).sum())
    assert torch.equal(starts.skill, library.clip_skill[moments[0][0]][:begun])
    assert 0.15 < starts.commanded.float().mean() < 0.35


def test_only_who_fell_goes_on_from_there(
    character: Character, library: MotionLibrary, generator: torch.Generator
) -> None:
    sampler = StartSampler(character, library, StartConfig(recovery=1.0, fallen=0.0, reference=0.0), 20, frames=1)
    worlds = torch.arange(20)
    fell = worlds % 2 == 0
    starts = sampler.draw(worlds, fell, generator)
    assert torch.equal(starts.kind, torch.where(fell, RECOVERY, DEFAULT))
    assert (starts.qpos[~fell, 2] == 0.89).all()
    sampler.on_ground = False
    assert (sampler.draw(worlds, fell, generator).kind == DEFAULT).all()


@pytest.mark.parametrize("shape", ["", "SuperLongLegs"])
def test_fallen_states_are_dropped_from_above_the_floor_whatever_the_legs(
    shape: str, library: MotionLibrary, generator: torch.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    dropped: list[torch.Tensor] = []

    class Watched(CpuPhysics):
        def write(self, env_ids: torch.Tensor, qpos: torch.Tensor, qvel: torch.Tensor) -> None:
            dropped.append(qpos.clone())
            super().write(env_ids, qpos, qvel)

    monkeypatch.setattr(
        starts, "make_physics", lambda character, n, threads: Watched(Scene(character), n, threads=threads)
    )
    body = load_body("sword_shield", BodyConfig(shape))
    sampler = StartSampler(body, library, StartConfig(drop_height=(0.9, 0.9)), 32, frames=1, threads=1)
    sampler.draw(torch.arange(32), torch.zeros(32, dtype=torch.bool), generator, FALLEN)
    [qpos] = dropped
    above = qpos[:, 2] - body.default_qpos[2]
    assert above.tolist() == pytest.approx([0.9 - load_character().default_qpos[2].item()] * 32)


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)
