"""Worlds in a batch against single MuJoCo simulations."""

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import make_physics
from murmillo.envs.physics.cpu import CpuPhysics
from murmillo.envs.residual import ResidualForces
from murmillo.envs.scene import Scene


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def actions(n: int, seed: int) -> torch.Tensor:
    return 0.6 * torch.rand(n, 31, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)) - 0.3


@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_steps_as_single_simulations_do_bit_for_bit(character, threads):
    physics, data = make_physics(character, 3, threads=threads), [mujoco.MjData(character.model) for _ in range(3)]
    for step in range(30):
        ctrl = character.targets(actions(3, step))
        physics.step(ctrl)
        for world, single in enumerate(data):
            single.ctrl[:] = ctrl[world].numpy()
            mujoco.mj_step(character.model, single, character.substeps)
            assert np.array_equal(single.qpos, physics.state.qpos[world].numpy())
            # derived fields are those of the new state, not of the last substep's beginning
            mujoco.mj_kinematics(character.model, single)
            np.testing.assert_allclose(physics.state.body_pos_w[world].numpy(), single.xpos[1:], rtol=0, atol=1e-12)


def test_standing_weighs_what_the_character_weighs(character):
    physics = make_physics(character, 1)
    stand = character.targets(character.action_for(character.default_qpos))[None]
    for _ in range(10):
        physics.step(stand)
    force = physics.state.ground_force_w[0]
    assert force.sum(0)[2].item() == pytest.approx(51.71 * 9.81, rel=0.05)
    feet = character.body_ids(character.feet)
    assert force[feet, 2].sum() == force[:, 2].sum()


def test_write_moves_only_the_worlds_it_names_and_forgets_their_past(character):
    physics, fresh = make_physics(character, 3), make_physics(character, 1)
    for step in range(5):
        physics.step(character.targets(actions(3, step)))
    before = physics.state.qpos[[0, 2]].clone()
    qpos = character.default_qpos[None].clone()
    qpos[0, 0] = 7.0
    physics.write(torch.tensor([1]), qpos, torch.zeros(1, 37))
    fresh.write(torch.tensor([0]), qpos, torch.zeros(1, 37))
    assert torch.equal(physics.state.qpos[[0, 2]], before)
    assert not physics.state.ground_force_w[1].any()
    for found, expected in zip(
        (physics.state.body_pos_w, physics.state.body_quat_w),
        character.forward_kinematics(physics.state.qpos),
        strict=True,
    ):
        assert torch.equal(found, expected)
    for step in range(5):
        ctrl = character.targets(actions(3, step))
        physics.step(ctrl)
        fresh.step(ctrl[1:2])
    assert torch.equal(physics.state.qpos[1], fresh.state.qpos[0])


def test_state_dict_continues_bit_for_bit(character):
    one, other = make_physics(character, 2), make_physics(character, 2)
    for step in range(10):
        one.step(character.targets(actions(2, step)))
    other.load_state_dict(one.state_dict())
    assert torch.equal(one.state.body_pos_w, other.state.body_pos_w)
    assert torch.equal(one.state.body_quat_w, other.state.body_quat_w)
    for step in range(10):
        for physics in (one, other):
            physics.step(character.targets(actions(2, step)))
    assert torch.equal(one.state.qpos, other.state.qpos)
    assert torch.equal(one.state.body_pos_w, other.state.body_pos_w)


def test_a_diverged_world_is_healed_alone_and_reported(character, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo leaves its warning in MUJOCO_LOG.TXT
    physics, sound = make_physics(character, 4), make_physics(character, 4)
    for step in range(3):
        for each in (physics, sound):
            each.step(character.targets(actions(4, step)))
    physics.state.qvel[2] = torch.nan
    for each in (physics, sound):
        each.step(character.targets(actions(4, 9)))
    assert physics.healed().tolist() == [False, False, True, False]
    assert not sound.healed().any()
    assert physics.state.qpos.isfinite().all()
    assert torch.equal(physics.state.qpos[[0, 1, 3]], sound.state.qpos[[0, 1, 3]])


def test_a_force_at_a_joint_brings_its_moment_about_the_centre_of_mass(character):
    """A force at the body origin accelerates the body as MuJoCo's mj_applyFT at that point does."""
    physics = CpuPhysics(Scene(character), 1)
    force = torch.zeros(1, 17, 3)
    arm = character.bodies.index("left_lower_arm")
    force[0, arm] = torch.tensor([20.0, -10.0, 5.0])
    ctrl = character.targets(torch.zeros(1, 31, dtype=torch.float64))
    single = mujoco.MjData(character.model)
    mujoco.mj_forward(character.model, single)
    single.ctrl[:] = ctrl[0].numpy()
    mujoco.mj_applyFT(
        character.model, single, force[0, arm].double().numpy(), np.zeros(3), single.xpos[arm + 1], arm + 1,
        single.qfrc_applied,
    )  # fmt: skip
    mujoco.mj_forward(character.model, single)
    physics._substeps = 1
    physics.step(ctrl, force)
    expected = single.qfrc_applied.copy()
    bodies = mujoco.MjData(character.model)
    bodies.xfrc_applied[1:] = physics._xfrc[0]
    mujoco.mj_kinematics(character.model, bodies)
    mujoco.mj_comPos(character.model, bodies)
    actual = np.zeros(37)
    for body in range(1, character.model.nbody):
        wrench = bodies.xfrc_applied[body]
        mujoco.mj_applyFT(character.model, bodies, wrench[:3], wrench[3:], bodies.xipos[body], body, actual)
    np.testing.assert_allclose(actual, expected, atol=1e-9)


def test_a_force_lasts_no_longer_than_its_step(character):
    pushed, free = make_physics(character, 1), make_physics(character, 1)
    ctrl = character.targets(torch.zeros(1, 31, dtype=torch.float64))
    pushed.step(ctrl, torch.full((1, 17, 3), 9.0))
    free.load_state_dict({**pushed.state_dict(), "xfrc_applied": torch.zeros(1, 18, 6)})
    for physics in (pushed, free):
        physics.step(ctrl)
    assert torch.equal(pushed.state.qpos, free.state.qpos)


def test_residual_forces_turn_with_the_heading_and_spare_what_is_carried(character):
    residual = ResidualForces(character, scale=50.0)
    assert residual.action_dim == 45
    physics = make_physics(character, 1)
    qpos = character.default_qpos[None].clone()
    qpos[0, 3:7] = torch.tensor([np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)])  # facing +y
    physics.write(torch.tensor([0]), qpos, torch.zeros(1, 37))
    action = torch.zeros(1, 15, 3, dtype=torch.float64)
    action[..., 0] = 0.5  # ahead
    force = residual(action.flatten(1), physics.state)[0]
    carried = character.body_ids(("sword", "shield"))
    assert not force[carried].any()
    others = [i for i in range(17) if i not in carried]
    torch.testing.assert_close(force[others], torch.tensor([0.0, 25.0, 0.0], dtype=torch.float64).expand(15, 3))


@pytest.mark.parametrize(("arguments", "named"), [({"num_envs": 0}, "num_envs=0"), ({"threads": -1}, "threads=-1")])
def test_impossible_arguments_are_named(character, arguments, named):
    with pytest.raises(SuiteError, match=named):
        make_physics(character, **{"num_envs": 1, **arguments})
