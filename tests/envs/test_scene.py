"""Props beside the character: where they lie, what they feel, and that the character does not notice them otherwise."""

from functools import partial

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import make_physics
from murmillo.envs.scene import Scene, add_box

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
    for name in ("qpos", "qvel", "body_pos_w", "body_quat_w", "body_com_w", "ground_force_w"):
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
    assert one.state.prop_qpos[0, 0, :3].tolist() == [50.0, 0.0, 0.1]


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
