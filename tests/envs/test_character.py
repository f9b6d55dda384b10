"""The character against its table, against MuJoCo's kinematics and against its own actuators."""

import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.geometry import lowest_point
from murmillo.envs.motion import load_clips

MASSES = {  # [kg] of the published character
    "pelvis": 9.996, "torso": 12.011, "head": 3.882, "right_upper_arm": 1.499, "right_lower_arm": 1.000,
    "right_hand": 0.500, "sword": 0.701, "left_upper_arm": 1.499, "left_lower_arm": 1.000, "shield": 2.121,
    "left_hand": 0.500, "right_thigh": 4.502, "right_shin": 3.000, "right_foot": 1.000, "left_thigh": 4.502,
    "left_shin": 3.000, "left_foot": 1.000,
}  # fmt: skip
GAINS = {  # kp, kd, torque limit, half width of the targets [rad]
    "abdomen": (1000, 100, 200, 1.885), "neck": (100, 10, 50, 1.257), "right_shoulder": (400, 40, 100, np.pi),
    "right_elbow": (300, 30, 70, 1.955), "right_wrist": (100, 10, 50, 1.885), "left_shoulder": (400, 40, 100, np.pi),
    "left_elbow": (300, 30, 70, 1.955), "right_hip": (500, 50, 200, 2.932), "right_knee": (500, 50, 150, 1.955),
    "right_ankle": (400, 40, 90, 1.152), "left_hip": (500, 50, 200, 2.932), "left_knee": (500, 50, 150, 1.955),
    "left_ankle": (400, 40, 90, 1.152),
}  # fmt: skip


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def random_qpos(character: Character, n: int, seed: int = 0) -> torch.Tensor:
    """Poses with joints inside the actions' range."""
    generator = torch.Generator().manual_seed(seed)
    action = torch.rand(n, character.action_dim, generator=generator, dtype=torch.float64) - 0.5
    root = torch.randn(n, 4, generator=generator, dtype=torch.float64)
    position = torch.randn(n, 3, generator=generator, dtype=torch.float64)
    return character.pose(character.targets(action), position, root / root.norm(dim=-1, keepdim=True))


def test_the_table_of_bodies_and_masses(character):
    masses = dict(zip(character.bodies, character.model.body_mass[1:], strict=True))
    assert list(masses) == list(MASSES)
    for body, mass in MASSES.items():
        assert masses[body] == pytest.approx(mass, abs=1e-3), body
    assert character.model.nv == 37
    assert character.model.opt.timestep == pytest.approx(1 / 120)


def test_the_table_of_gains_and_targets(character):
    model = character.model
    assert [joint.name for joint in character.joints] == list(GAINS)
    for joint in character.joints:
        kp, kd, effort, half_width = GAINS[joint.name]
        for i in range(joint.action.start, joint.action.stop):
            assert (model.actuator_gainprm[i, 0], -model.actuator_biasprm[i, 2]) == (kp, kd), joint.name
            assert tuple(model.actuator_forcerange[i]) == (-effort, effort), joint.name
            assert float(character.action_scale[i]) == pytest.approx(half_width, abs=1e-3), joint.name
    offsets = {joint.name: character.action_offset[joint.action] for joint in character.joints}
    assert offsets["left_elbow"].item() == pytest.approx(-1.396, abs=1e-3)
    assert offsets["left_knee"].item() == pytest.approx(1.396, abs=1e-3)
    assert all(not offsets[joint.name].any() for joint in character.joints if joint.kind == "ball")


def test_soles_touch_the_ground_in_the_zero_pose(character):
    assert lowest_point(character, character.default_qpos).item() == pytest.approx(0.0, abs=1e-4)


def test_forward_kinematics_of_a_pose_does_not_depend_on_the_poses_beside_it(character):
    poses = random_qpos(character, 37)
    together = character.forward_kinematics(poses)
    for chosen in ([], [5], [0, 36], list(range(1, 30))):
        for alone, among in zip(character.forward_kinematics(poses[chosen]), together, strict=True):
            assert torch.equal(alone, among[chosen])


def test_forward_kinematics_is_mujocos(character):
    data = mujoco.MjData(character.model)
    poses = random_qpos(character, 16)
    pos, quat = character.forward_kinematics(poses)
    for i, pose in enumerate(poses):
        data.qpos[:] = pose.numpy()
        mujoco.mj_forward(character.model, data)
        np.testing.assert_allclose(pos[i], data.xpos[1:], atol=1e-12)
        sign = np.sign((quat[i].numpy() * data.xquat[1:]).sum(-1, keepdims=True))
        np.testing.assert_allclose(sign * quat[i].numpy(), data.xquat[1:], atol=1e-12)
        np.testing.assert_allclose(character.joint_coordinates(pose), data.actuator_length, atol=1e-9)


def test_lowest_point_is_where_mujoco_finds_contact(character):
    """Lowered to a hair's breadth into the floor there is contact, raised to a hair's breadth above there is none."""
    data = mujoco.MjData(character.model)
    floor = character.model.geom("floor").id
    for pose in random_qpos(character, 16, seed=1):
        low = lowest_point(character, pose)
        for gap, touched in ((-2e-3, True), (1e-3, False)):
            data.qpos[:] = pose.numpy()
            data.qpos[2] += gap - low.item()
            mujoco.mj_forward(character.model, data)
            pairs = [data.contact.geom[i] for i in range(data.ncon) if data.contact.dist[i] < 0]
            assert any(floor in pair for pair in pairs) is touched


def test_action_for_inverts_targets(character):
    poses = random_qpos(character, 8)
    action = character.action_for(poses)
    torch.testing.assert_close(character.targets(action), character.joint_coordinates(poses))
    assert torch.equal(character.targets(torch.full((31,), 7.0)), character.targets(torch.ones(31)))


@pytest.mark.parametrize("name", ["slash_down", "kick", "block_high"])
def test_actuators_reach_a_clips_pose_as_exponential_map_targets(name):
    """Without gravity and ground, joints settle in the clip's rotations when those are their targets."""

    def weightless(spec: mujoco.MjSpec) -> None:
        spec.option.gravity = [0, 0, 0]
        for geom in spec.geoms:
            geom.contype = geom.conaffinity = 0

    character = load_character(edit=weightless)
    clip = next(clip for clip in load_clips("builtin", character) if clip.name == name)
    pose = torch.tensor(clip.qpos[clip.frames // 2])
    action = character.action_for(pose)
    assert action.abs().max() < 1.0  # within reach
    data = mujoco.MjData(character.model)
    data.ctrl[:] = character.targets(action).numpy()
    mujoco.mj_step(character.model, data, 600)
    reached = torch.from_numpy(data.qpos.copy())
    for joint in character.joints:
        if joint.kind == "ball":
            alignment = (reached[joint.qpos] * pose[joint.qpos]).sum().abs()
            assert 2 * torch.acos(alignment.clamp(max=1)) < 2e-3, joint.name
        else:
            assert reached[joint.qpos].item() == pytest.approx(pose[joint.qpos].item(), abs=1e-3), joint.name


def test_visual_geoms_are_left_out_of_the_physics_but_not_of_the_picture(character):
    full = character.render_model()
    assert full.ngeom > 2 * character.model.ngeom
    np.testing.assert_allclose(full.body_mass, character.model.body_mass)
    assert full.nq == character.model.nq


def test_an_unknown_character_is_refused_by_name():
    with pytest.raises(SuiteError, match=r"character=sword_shiled: .* sword_shield"):
        load_character("sword_shiled")


def test_a_model_that_breaks_a_convention_is_refused():
    def rotate(spec: mujoco.MjSpec) -> None:
        spec.body("head").quat = [0.7, 0.7, 0, 0]

    with pytest.raises(SuiteError, match="rotated in its parent"):
        load_character(edit=rotate)


def test_a_joint_of_an_unknown_kind_is_refused():
    def add_a_crate(spec: mujoco.MjSpec) -> None:
        crate = spec.worldbody.add_body(name="crate", pos=[2, 0, 0.2])
        crate.add_geom(size=[0.2, 0.2, 0.2])
        crate.add_freejoint(name="crate")

    with pytest.raises(SuiteError, match="joint crate is neither a ball nor a hinge"):
        load_character(edit=add_a_crate)


def test_the_humanoid_is_the_murmillo_with_empty_hands(character):
    """Its 15 bodies weigh the same; action 0 is the middle of each range, 1 a whole range away (AdaptNet's mapping)."""
    humanoid = load_character("humanoid")
    assert humanoid.bodies == tuple(body for body in character.bodies if body not in ("sword", "shield"))
    assert humanoid.action_dim == 28
    assert humanoid.key_bodies == ("right_hand", "left_hand", "right_foot", "left_foot")
    for body, mass in zip(humanoid.bodies, humanoid.model.body_mass[1:], strict=True):
        assert mass == pytest.approx(MASSES[body], abs=1e-3), body
    low, high = humanoid.joint_limits.unbind(-1)
    torch.testing.assert_close(humanoid.action_offset, 0.5 * (low + high), atol=1e-6, rtol=0)
    torch.testing.assert_close(humanoid.action_scale, high - low, atol=1e-6, rtol=0)
    gains = {
        "abdomen": (600, 60, 125), "neck": (50, 5, 20), "right_shoulder": (200, 20, 70), "left_elbow": (150, 15, 60),
        "left_hip": (300, 30, 125), "right_knee": (300, 30, 100), "left_ankle": (200, 20, 50),
    }  # fmt: skip
    for name, (kp, kd, effort) in gains.items():
        i = next(joint.action.start for joint in humanoid.joints if joint.name == name)
        assert (humanoid.model.actuator_gainprm[i, 0], -humanoid.model.actuator_biasprm[i, 2]) == (kp, kd), name
        assert tuple(humanoid.model.actuator_forcerange[i]) == (-effort, effort), name
    assert lowest_point(humanoid, humanoid.default_qpos).item() == pytest.approx(0.0, abs=1e-4)


def test_joint_limits_are_the_published_boxes(character):
    boxes = {joint.name: np.degrees(character.joint_limits[joint.action].numpy()) for joint in character.joints}
    np.testing.assert_allclose(boxes["abdomen"], [[-60, 60], [-60, 90], [-50, 50]], atol=1e-4)
    np.testing.assert_allclose(boxes["left_hip"], [[-15, 60], [-140, 60], [-35, 60]], atol=1e-4)
    np.testing.assert_allclose(boxes["right_knee"], [[0, 160]], atol=1e-4)


def test_a_ball_joint_without_a_box_is_refused():
    def forget(spec: mujoco.MjSpec) -> None:
        spec.joint("neck").userdata = []

    with pytest.raises(SuiteError, match="joint neck: has no box"):
        load_character(edit=forget)
