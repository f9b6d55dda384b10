"""Props beside the character: where they lie, what they feel, and that the character does not notice them otherwise."""

from functools import partial

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.falls import count_every_contact
from murmillo.envs.physics import Physics, make_physics
from murmillo.envs.scene import Scene, add_box, aside

CUBE = partial(add_box, name="cube", size=(0.2, 0.2, 0.2), mass=0.8)


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def test_a_far_prop_changes_nothing_for_the_character(character):
    alone, beside = make_physics(character, 2), make_physics(Scene(character, CUBE), 2)
    for each in (alone, beside):
        each.write(torch.arange(2), character.default_qpos.expand(2, -1), torch.zeros(2, character.model.nv))
        for _ in range(5):
            each.step(character.targets(torch.full((2, 31), 0.3, dtype=torch.float64)))
    for name in ("qpos", "qvel", "body_pos_w", "body_quat_w", "ground_force_w"):
        torch.testing.assert_close(getattr(alone.state, name), getattr(beside.state, name), atol=1e-9, rtol=0)
    assert alone.state.prop_qpos.shape == (2, 0, 7)
    assert beside.state.prop_qpos.shape == (2, 1, 7)


def test_a_prop_is_felt_by_the_body_that_it_hits_and_by_no_other(character):
    physics = make_physics(Scene(character, CUBE), 3)
    head = character.bodies.index("head")
    physics.write(torch.arange(3), character.default_qpos.expand(3, -1), torch.zeros(3, character.model.nv))
    physics.state.prop_qpos[1, 0, :3] = physics.state.body_pos_w[1, head] + torch.tensor([0.0, 0.0, 0.32])
    physics.state.prop_qvel[1, 0, 2] = -3.0
    felt = torch.zeros(3, len(character.bodies))
    for _ in range(3):
        physics.step(character.targets(torch.zeros(3, 31, dtype=torch.float64)))
        felt = torch.maximum(felt, physics.state.hit_force_w[:, 0].abs().amax(-1).float())
    assert felt[1].nonzero().flatten().tolist() == [head]
    assert felt[1, head] > 10.0
    assert not felt[[0, 2]].any()


def test_a_hit_within_a_step_is_felt_at_its_end(character):
    """A fast cube touches in one substep of four only; the last alone would miss most of them."""
    physics = make_physics(Scene(character, partial(CUBE, margin=0.1)), 64)
    torso = character.bodies.index("torso")
    physics.write(torch.arange(64), character.default_qpos.expand(64, -1), torch.zeros(64, character.model.nv))
    start = torch.linspace(1.0, 2.3, 64, dtype=torch.float64)
    physics.state.prop_qpos[:, 0, :3] = physics.state.body_pos_w[:, torso] + torch.tensor([0.0, 0.0, 0.1])
    physics.state.prop_qpos[:, 0, 0] -= start
    physics.state.prop_qvel[:, 0, 0] = 35.0
    felt = torch.zeros(64, dtype=torch.bool)
    for _ in range(3):
        physics.step(character.targets(torch.zeros(64, 31, dtype=torch.float64)))
        felt |= (physics.state.hit_force_w[:, 0].abs() > 1.0).flatten(1).any(-1)
    assert felt.all()


@pytest.fixture
def thrown(character):
    """Makes physics with a cube on its way to the torso of each of 16 worlds, from 0.4 to 1.6 m away."""

    def make(threads: int = 1) -> Physics:
        physics = make_physics(Scene(character, partial(CUBE, margin=0.1)), 16, threads=threads)
        physics.write(torch.arange(16), character.default_qpos.expand(16, -1), torch.zeros(16, character.model.nv))
        torso = physics.state.body_pos_w[:, character.bodies.index("torso")]
        physics.state.prop_qpos[:, 0, :3] = torso + torch.tensor([0.0, 0.0, 0.1])
        physics.state.prop_qpos[:, 0, 0] -= torch.linspace(0.4, 1.6, 16, dtype=torch.float64)
        physics.state.prop_qvel[:, 0, 0] = 35.0
        return physics

    return make


def test_what_is_felt_is_the_greatest_force_of_the_substeps(character, thrown):
    physics = thrown()
    model = Scene(character, partial(CUBE, margin=0.1)).model
    sensors = slice(character.contact_slice.stop, model.nsensordata)
    ctrl = character.targets(torch.zeros(16, 31, dtype=torch.float64))
    data = mujoco.MjData(model)
    before = physics.state_dict()
    physics.step(ctrl)
    for world in range(16):
        data.qpos, data.qvel, data.ctrl = before["qpos"][world], before["qvel"][world], ctrl[world]
        data.qacc_warmstart = before["qacc_warmstart"][world]
        greatest = np.zeros(3 * len(character.bodies))
        for _ in range(character.substeps):
            mujoco.mj_step(model, data)
            force = data.sensordata[sensors]
            greatest = np.where(np.abs(force) > np.abs(greatest), force, greatest)
        np.testing.assert_array_equal(physics.state.hit_force_w[world].flatten(), greatest)
    assert physics.state.hit_force_w.flatten(1).any(-1).sum() > 4


def test_hits_are_felt_whatever_the_ground_sensors_count(character, thrown):
    physics, every = thrown(), load_character(edit=count_every_contact)
    other = make_physics(Scene(every, partial(CUBE, margin=0.1)), 16, threads=1)
    other.load_state_dict(physics.state_dict())
    ctrl = character.targets(torch.zeros(16, 31, dtype=torch.float64))
    for one in (physics, other):
        one.step(ctrl)
    assert physics.state.hit_force_w.any()
    assert torch.equal(physics.state.hit_force_w, other.state.hit_force_w)
    ids = torch.arange(0, 16, 2)
    physics.write(ids, character.default_qpos.expand(8, -1), torch.zeros(8, character.model.nv))
    assert not physics.state.hit_force_w[ids].any()
    assert physics.state.hit_force_w[ids + 1].any()


def test_hits_are_alike_at_any_number_of_threads_and_after_loading(character, thrown):
    one, other, late = thrown(1), thrown(3), thrown(1)
    ctrl = character.targets(torch.zeros(16, 31, dtype=torch.float64))
    begin = one.state_dict()
    for _ in range(5):
        late.step(ctrl)
    late.load_state_dict(begin)
    for _ in range(2):
        for physics in (one, other, late):
            physics.step(ctrl)
        assert one.state.hit_force_w.any()
        for physics in (other, late):
            assert torch.equal(one.state.hit_force_w, physics.state.hit_force_w)
            assert torch.equal(one.state.prop_qpos, physics.state.prop_qpos)
            assert torch.equal(one.state.qpos, physics.state.qpos)


def test_props_are_kept_with_the_state_and_go_back_with_a_write(character):
    one, other = (make_physics(Scene(character, CUBE), 1) for _ in range(2))
    ctrl = character.targets(torch.zeros(1, 31, dtype=torch.float64))
    one.state.prop_qvel[0, 0, 0] = 2.0
    one.step(ctrl)
    other.load_state_dict(one.state_dict())
    for each in (one, other):
        each.step(ctrl)
    assert torch.equal(one.state.prop_qpos, other.state.prop_qpos)
    assert one.state.prop_qpos[0, 0, 0] > 50.05
    one.write(torch.tensor([0]), character.default_qpos[None], torch.zeros(1, character.model.nv))
    assert one.state.prop_qpos[0, 0, :3].tolist() == list(aside(0))


def test_what_is_no_prop_is_refused(character):
    def hinged(spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_body(name="door").add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)

    def unfelt(spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_body(name="ghost", mass=1.0, inertia=[1, 1, 1]).add_freejoint()

    def grown(spec: mujoco.MjSpec) -> None:
        spec.body("head").add_body(name="plume")

    for edit, words in ((hinged, "door"), (unfelt, "hit_"), (grown, "character")):
        with pytest.raises((SuiteError, ValueError), match=words):
            Scene(character, edit)


def test_pictures_show_props_and_markers(character):
    from murmillo.envs.markers import Marker
    from murmillo.envs.rendering import FrameRenderer

    scene = Scene(character, partial(CUBE, rgba=(0.0, 1.0, 0.0, 1.0)))
    try:
        renderer = FrameRenderer(scene, 160, 120)
    except SuiteError as error:
        pytest.skip(str(error))
    qpos = np.concatenate((character.default_qpos.numpy(), [50.0, 0, 0.1, 1, 0, 0, 0]))
    empty = renderer.frame(qpos)
    qpos[47:50] = [0.6, 0.0, 1.0]
    assert (renderer.frame(qpos) != empty).any()
    qpos[47:50] = [50.0, 0.0, 0.1]
    ball = renderer.frame(qpos, [Marker((0.5, 0.0, 1.0), size=0.2)])
    arrow = renderer.frame(qpos, [Marker((0.5, 0.0, 1.0), (0.0, 0.0, 1.0), size=0.5)])
    assert (ball != empty).any()
    assert (arrow != empty).any()
    assert (ball != arrow).any()
    renderer.close()


def test_a_box_with_a_margin_lies_on_the_ground(character):
    scene = Scene(character, lambda spec: add_box(spec, "cube", (0.2, 0.2, 0.2), 0.8, margin=0.1))
    data = mujoco.MjData(scene.model)
    data.qpos[-7:] = [2.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]
    for _ in range(240):
        mujoco.mj_step(scene.model, data)
    assert data.qpos[-5] == pytest.approx(0.1, abs=0.002)
