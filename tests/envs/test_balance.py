"""Targets that keep a character over its feet."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.balance import Balance
from murmillo.envs.bodies import BodyConfig
from murmillo.envs.character import Character, load_character
from murmillo.envs.config import EnvConfig
from murmillo.envs.physics import State
from murmillo.envs.rotations import quat_from_rotvec, quat_mul, quat_rotate
from murmillo.envs.starts import StartConfig
from murmillo.envs.tracking import TrackingConfig

WORLDS = 24
FEET = ["right_foot", "left_foot"]


@pytest.fixture(scope="module")
def env() -> HumanoidVectorEnv:
    """Worlds in the middle of a walk, some of them pushed about."""
    env = HumanoidVectorEnv(WORLDS, config("walk_forward"))
    env.reset(seed=2)
    generator = torch.Generator().manual_seed(0)
    for _ in range(6):
        env.step(env.guide() + 0.05 * torch.randn(WORLDS, 31, generator=generator))
    return env


def config(*clips: str, **settings) -> EnvConfig:
    return EnvConfig(
        clips=clips,
        threads=1,
        tensors=True,
        starts=StartConfig(reference=1.0, commanded=1.0, fallen=0.0, recovery=0.0),
        tracking=TrackingConfig(follow=True, switch=0.0, lost=9.0, patience=60.0),
        **settings,
    )


def asked(env: HumanoidVectorEnv, state: State | None = None, ground: Tensor | None = None) -> tuple[Tensor, Tensor]:
    """The clips' poses as targets, without balance and with it."""
    qpos, qvel = wanted(env)
    before = env.character.joint_coordinates(qpos)
    return before, Balance(env.character)(before, state or env.state, qpos, qvel, ground)


def wanted(env: HumanoidVectorEnv) -> tuple[Tensor, Tensor]:
    """The clips now."""
    assert env._tracker is not None
    return env._tracker.wanted(0.0)


def shares(env: HumanoidVectorEnv) -> Tensor:
    """[N, 2] of the weight that the feet bear where they touch the ground."""
    balance, (qpos, qvel) = Balance(env.character), wanted(env)
    return balance._shares(balance._posture(*env.character.forward_kinematics(qpos), qvel))


def columns(character: Character, names: list[str]) -> list[int]:
    return [
        i for joint in character.joints if joint.name in names for i in range(joint.action.start, joint.action.stop)
    ]


def test_legs_make_the_force_that_is_wanted(env: HumanoidVectorEnv) -> None:
    """Against MuJoCo's Jacobian of the centre of mass as if the foot held it: where that stays, the body goes."""
    character, balance, model = env.character, Balance(env.character), env.character.model
    (before, after), (qpos, qvel) = asked(env), wanted(env)
    clip = balance._posture(*character.forward_kinematics(qpos), qvel)
    state = env.state
    here = balance._posture(state.body_pos_w.float(), state.body_quat_w.float(), state.qvel.float())
    share = shares(env)
    force, moment = balance._wrench(clip, here, share, 0.0)
    data, tested = mujoco.MjData(model), 0
    for world in range(WORLDS):
        data.qpos[:] = state.qpos[world].numpy()
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        torch.testing.assert_close(here.centre[world].double(), torch.tensor(data.subtree_com[1]), atol=1e-5, rtol=0)
        for number, foot in enumerate(FEET):
            side = foot.split("_")[0]
            body = character.bodies.index(foot)
            if state.ground_force_w[world, body, 2] < 20.0:
                continue
            linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, linear, angular, data.subtree_com[1], body + 1)
            torque = -(torch.tensor(linear).T.float() @ force[world] + torch.tensor(angular).T.float() @ moment[world])
            mine = columns(character, [f"{side}_hip", f"{side}_knee"])
            gain = torch.tensor(model.actuator_gainprm[mine, 0]).float()
            expected = share[world, number] * torque[6:][mine] / gain
            torch.testing.assert_close((after - before)[world, mine], expected, atol=2e-4, rtol=1e-3)
            tested += bool(share[world, number] > 0)
    assert tested > WORLDS / 2
    legs = [f"{side}_{joint}" for side in ("right", "left") for joint in ("hip", "knee", "ankle")]
    others = sorted(set(range(31)) - set(columns(character, legs)))
    torch.testing.assert_close(after[:, others], before[:, others])


def test_an_ankle_does_not_tip_its_foot(env: HumanoidVectorEnv) -> None:
    """Its torque keeps the centre of pressure within the sole: 4.35 cm behind the ankle, 13.35 ahead, 4.5 beside."""
    character = env.character
    _, after = asked(env)
    torque = 400.0 * (after - character.joint_coordinates(env.state.qpos)) - 40.0 * env.state.qvel[:, 6:]
    stood = 0
    for number, foot in enumerate(FEET):
        ankle = columns(character, [f"{foot.split('_')[0]}_ankle"])
        pressed = env.state.ground_force_w[:, character.bodies.index(foot), 2]
        share = shares(env)[:, number]
        standing = (pressed > 20.0) & (share > 0)
        borne = torch.maximum(pressed, 0.5 * share * 51.7 * 9.81)[standing]
        roll, pitch, _ = (torque[standing][:, ankle] / borne.unsqueeze(-1)).unbind(-1)
        assert (roll.abs() < 0.0451).all()
        assert (pitch > -0.0436).all()
        assert (pitch < 0.1336).all()
        stood += int(standing.sum())
        assert (pitch < -0.043).any() or (pitch > 0.133).any() or (roll.abs() > 0.0449).any()
    assert stood > WORLDS / 2


def test_who_does_not_touch_the_ground_follows_the_clip(env: HumanoidVectorEnv) -> None:
    before, after = asked(env, replace(env.state, ground_force_w=torch.zeros_like(env.state.ground_force_w)))
    torch.testing.assert_close(after, before)


def test_a_foot_that_the_clip_lifts_follows_it_though_it_drags(env: HumanoidVectorEnv) -> None:
    """And one that stands bears half of its share at least: what it felt last may have been a bounce."""
    character, (qpos, _) = env.character, wanted(env)
    grazed = torch.zeros_like(env.state.ground_force_w)
    grazed[..., 2] = 20.0
    before, after = asked(env, replace(env.state, ground_force_w=grazed))
    height = character.forward_kinematics(qpos)[0][..., 2]
    standing = character.forward_kinematics(character.default_qpos)[0][..., 2]
    torque = 400.0 * (after - character.joint_coordinates(env.state.qpos)) - 40.0 * env.state.qvel[:, 6:]
    lifted = 0
    for foot in FEET:
        side, body = foot.split("_")[0], character.bodies.index(foot)
        leg = columns(character, [f"{side}_hip", f"{side}_knee", f"{side}_ankle"])
        up = height[:, body] - standing[body] > 0.031
        torch.testing.assert_close(after[up][:, leg], before[up][:, leg])
        assert (after[~up][:, leg] - before[~up][:, leg]).abs().amax() > 0.1
        pitch = torque[~up][:, columns(character, [f"{side}_ankle"])][:, 1]
        assert pitch.abs().max() > 1.5 * 0.1335 * 20.0
        lifted += int(up.sum())
    assert lifted > WORLDS / 4


def test_neither_place_nor_heading_nor_the_height_of_the_ground_count(env: HumanoidVectorEnv) -> None:
    turn, shift = quat_from_rotvec(torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)), torch.tensor([3.0, -2.0, 0.1])
    state, qpos, qvel = env.state, env.state.qpos.clone(), env.state.qvel.clone()
    qpos[:, :3] = quat_rotate(turn, qpos[:, :3]) + shift
    qpos[:, 3:7] = quat_mul(turn.expand(WORLDS, 4), qpos[:, 3:7])
    qvel[:, :3] = quat_rotate(turn, qvel[:, :3])
    moved = replace(
        state,
        qpos=qpos,
        qvel=qvel,
        body_pos_w=quat_rotate(turn, state.body_pos_w) + shift,
        body_quat_w=quat_mul(turn.expand_as(state.body_quat_w), state.body_quat_w),
    )
    _, here = asked(env)
    _, there = asked(env, moved, torch.full((WORLDS,), 0.1, dtype=torch.float64))
    torch.testing.assert_close(there, here, atol=2e-4, rtol=0)


def test_a_guard_is_held_where_targets_alone_fall() -> None:
    standing = {}
    for balanced in (False, True):
        env = HumanoidVectorEnv(WORLDS, config("guard", autoreset="same_step"))
        env.reset(seed=0)
        assert env._tracker is not None
        up = torch.ones(WORLDS, dtype=torch.bool)
        for _ in range(300):
            lead = env.character.action_for(env._tracker.wanted(env.character.lag)[0]).float()
            up &= ~env.step(env.guide() if balanced else lead)[2]
        standing[balanced] = up.float().mean().item()
    assert standing[False] < 0.1
    assert standing[True] > 0.9


def test_a_body_with_locked_ankles_is_led_too() -> None:
    env = HumanoidVectorEnv(WORLDS, config("guard", body=BodyConfig(locked=("ankles",))))
    env.reset(seed=0)
    balance = Balance(env.character)
    assert [(leg.ankle, len(leg.joints)) for leg in balance._legs] == [(None, 2), (None, 2)]
    for _ in range(20):
        assert not env.step(env.guide())[2].any()


def test_balance_is_for_two_feet() -> None:
    character = load_character()
    character.feet = ("right_foot", "left_foot", "sword")
    with pytest.raises(SuiteError, match="has 3 feet; balance is for two"):
        Balance(character)
