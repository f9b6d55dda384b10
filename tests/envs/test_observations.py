"""The 120-D state: against hand-made poses, and the same from a clip's pose as from the simulation."""

import mujoco
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.observations import character_state, feature_mask, state_dim
from murmillo.envs.physics import make_physics
from murmillo.envs.rotations import quat_from_rotvec, quat_mul, quat_rotate


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def moving_pose(character: Character, seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    action = 0.6 * torch.rand(1, 31, generator=generator, dtype=torch.float64) - 0.3
    root = torch.randn(1, 4, generator=generator, dtype=torch.float64)
    position = torch.randn(1, 3, generator=generator, dtype=torch.float64) * 5.0
    qpos = character.pose(character.targets(action), position, root / root.norm(dim=-1, keepdim=True))
    return qpos, torch.randn(1, 37, generator=generator, dtype=torch.float64)


def features(character: Character, qpos: torch.Tensor, qvel: torch.Tensor) -> torch.Tensor:
    return character_state(character, qpos, qvel, character.key_positions(qpos))


def test_width(character):
    assert state_dim(character) == 120
    qpos, qvel = moving_pose(character, 0)
    for shape in ((), (1,), (0,), (2, 3)):
        poses = (part[0].expand(*shape, -1) for part in (qpos, qvel))
        assert features(character, *poses).shape == (*shape, 120)


def test_the_default_pose_reads_as_the_table_says(character):
    qpos = character.default_qpos.clone()
    qpos[0:2] = torch.tensor([3.0, -4.0])
    qvel = torch.zeros(37, dtype=torch.float64)
    qvel[0], qvel[5], qvel[6] = 1.5, 0.5, -2.0
    state = features(character, qpos, qvel)
    identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    assert state[0].item() == pytest.approx(0.8814)
    assert state[1:7].tolist() == identity
    assert state[7:13].tolist() == [1.5, 0, 0, 0, 0, 0.5]
    joints = []
    for joint in character.joints:
        joints += identity if joint.kind == "ball" else [0.0]
    assert state[13:71].tolist() == joints
    assert state[71:102].tolist() == [-2.0] + 30 * [0.0]
    keys = state[102:].view(6, 3)
    torch.testing.assert_close(keys[2], torch.tensor([0.0, -0.084887, -0.831416]), atol=1e-5, rtol=0)  # right foot
    torch.testing.assert_close(keys[4], torch.tensor([0.71595, -0.18311, -0.054084]), atol=1e-5, rtol=0)  # sword tip


@pytest.mark.parametrize("seed", range(5))
def test_place_and_heading_do_not_matter(character, seed):
    """Turned about the vertical and carried elsewhere, the character feels the same."""
    qpos, qvel = moving_pose(character, seed)
    turn = quat_from_rotvec(torch.tensor([[0.0, 0.0, 1.0 + seed]], dtype=torch.float64))
    moved, velocity = qpos.clone(), qvel.clone()
    moved[:, :3] = quat_rotate(turn, qpos[:, :3]) + torch.tensor([2.0, 7.0, 0.0])
    moved[:, 3:7] = quat_mul(turn, qpos[:, 3:7])
    velocity[:, :3] = quat_rotate(turn, qvel[:, :3])  # world frame; the angular velocity is the root's own
    torch.testing.assert_close(features(character, moved, velocity), features(character, qpos, qvel), atol=1e-5, rtol=0)


@pytest.mark.parametrize("seed", range(5))
def test_the_simulation_gives_the_features_of_the_pose(character, seed):
    physics = make_physics(character, 1)
    qpos, qvel = moving_pose(character, seed)
    physics.write(torch.tensor([0]), qpos, qvel)
    state = physics.state
    simulated = character_state(character, state.qpos, state.qvel, state.key_pos_w)
    torch.testing.assert_close(simulated, features(character, qpos, qvel), atol=1e-5, rtol=0)


def test_velocities_are_those_mujoco_integrates(character):
    """Root velocities in the heading frame equal the finite difference of what MuJoCo does with qvel."""
    qpos, qvel = moving_pose(character, 1)
    dt, later = 1e-6, qpos[0].numpy().copy()
    mujoco.mj_integratePos(character.model, later, qvel[0].numpy(), dt)
    then = features(character, torch.from_numpy(later)[None], qvel)[0].double()
    now = features(character, qpos, qvel)[0].double()
    assert ((then[0] - now[0]) / dt).item() == pytest.approx(qvel[0, 2].item(), abs=0.2)  # float32 resolution
    world = qvel[0, :3]
    assert now[7:10].norm().item() == pytest.approx(world.norm().item(), rel=1e-5)
    assert now[9].item() == pytest.approx(world[2].item(), rel=1e-5)
    angular_w = quat_rotate(qpos[0, 3:7], qvel[0, 3:6])
    assert now[12].item() == pytest.approx(angular_w[2].item(), rel=1e-5)


def test_masked_bodies_are_the_only_ones_whose_features_are_left_out(character):
    """Moving sword or shield changes masked features alone; moving anything else changes others."""
    qpos = character.default_qpos.clone()
    qpos[7:] = torch.rand(len(qpos) - 7, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    for joint in character.joints:
        if joint.kind == "ball":
            qpos[joint.qpos] /= qpos[joint.qpos].norm()
    wrist = next(joint for joint in character.joints if joint.name == "right_wrist")
    turned = qpos.clone()
    turned[wrist.qpos] = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    still = torch.zeros(character.model.nv, dtype=torch.float64)

    def state(pose):
        return character_state(character, pose, still, character.key_positions(pose))

    mask = feature_mask(character, ("sword",))
    assert mask.sum() == 6 + 3 + 3  # rotation and velocity of the wrist, the tip
    changed = state(qpos) != state(turned)
    assert changed.any()
    assert not (changed & ~mask).any()
    assert feature_mask(character, ("shield",)).nonzero().flatten().tolist() == [117, 118, 119]
    assert feature_mask(character, ("sword", "shield")).sum() == 15
    assert not feature_mask(character, ()).any()


def test_the_velocity_of_the_masked_joint_is_left_out_and_no_other(character):
    qpos = character.default_qpos.clone()
    mask, still = feature_mask(character, ("sword",)), torch.zeros(character.model.nv, dtype=torch.float64)
    rest = features(character, qpos, still)
    for joint in character.joints:
        spinning = still.clone()
        spinning[joint.dof] = 1.0
        changed = features(character, qpos, spinning) != rest
        assert changed.any()
        assert mask[changed].tolist() == int(changed.sum()) * [joint.name == "right_wrist"], joint.name
