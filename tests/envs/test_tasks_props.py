"""Tasks with props: Strike, Block and Recovery, by hand-made states of the props and of what is felt."""

import math
from typing import Any

import pytest
import torch

from murmillo.envs import EnvConfig, HumanoidVectorEnv, SuiteError
from murmillo.envs.registration import make_task
from murmillo.envs.starts import StartConfig
from murmillo.envs.tasks.props import aimed

DEFAULT = StartConfig(reference=0.0, fallen=0.0, recovery=0.0)


def make(name: str, num_envs: int = 2, **arguments: Any) -> Any:
    """The environment in its default pose, its task at `.task`."""
    config = EnvConfig(starts=DEFAULT, autoreset="disabled", threads=1)
    env: Any = HumanoidVectorEnv(num_envs, config, make_task(name, **arguments))
    env.reset(seed=0)
    return env


def rest(env: Any) -> torch.Tensor:
    return torch.zeros(env.num_envs, 31)


def hit(env: Any, world: int, body: str, force: float) -> None:
    """Let a prop press on a body, as far as the task can tell."""
    env.state.hit_force_w[world, 0, env.character.bodies.index(body)] = torch.tensor([0.0, force, 0.0])


def tilt(env: Any, world: int, angle: float) -> None:
    env.state.prop_qpos[world, 0, 3:] = torch.tensor([math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0])


def test_strike_pays_the_tilt_from_standing_to_lying() -> None:
    env = make("Strike", 4)
    for world, angle in enumerate((0.0, math.pi / 3, math.pi / 2, 0.75 * math.pi)):
        tilt(env, world, angle)
    torch.testing.assert_close(env.task.reward(env.state)["tilt"].float(), torch.tensor([0.0, 0.5, 1.0, 1.0]))


def test_strike_as_released_also_pays_the_approach_and_all_once_it_is_down() -> None:
    env = make("Strike", 3, form="code")
    ahead = env.state.prop_qpos[:, 0, :2] - env.state.qpos[:, :2]
    way = ahead / ahead.norm(dim=-1, keepdim=True)
    velocity = torch.zeros(3, env.character.model.nv, dtype=torch.float64)
    velocity[0, :2], velocity[1, :2] = 0.5 * way[0], 3.0 * way[1]
    props = env.state.prop_qpos.clone()
    env.physics.write(torch.arange(3), env.state.qpos.clone(), velocity)
    env.state.prop_qpos.copy_(props)
    tilt(env, 2, math.acos(0.19))
    terms = env.task.reward(env.state)
    torch.testing.assert_close(terms["tilt"].float(), torch.tensor([0.0, 0.0, 0.6]))
    torch.testing.assert_close(terms["approach"].float(), torch.tensor([0.4 * math.exp(-1.0), 0.4, 0.4]))


@pytest.mark.parametrize(
    ("form", "body", "ends"),
    [
        ("paper", "sword", False), ("paper", "left_foot", False), ("paper", "right_hand", True),
        ("paper", "shield", True), ("code", "right_hand", False), ("code", "head", True),
    ],
)  # fmt: skip
def test_only_the_sword_may_touch_the_target(form: str, body: str, ends: bool) -> None:
    env = make("Strike", form=form)
    assert not env.task.terminated(env.state).any()
    hit(env, 1, body, 0.9)
    assert not env.task.terminated(env.state).any()
    hit(env, 1, body, -1.1)
    assert env.task.terminated(env.state).tolist() == [False, ends]


def test_targets_stand_at_the_distances_asked_for() -> None:
    env = make("Strike", 400, near=0.5, near_distance=(0.5, 1.0), far_distance=(6.0, 7.0))
    away = (env.state.prop_qpos[:, 0, :2] - env.state.qpos[:, :2]).norm(dim=-1)
    near = (away >= 0.5) & (away <= 1.0)
    assert (near | ((away >= 6.0) & (away <= 7.0))).all()
    assert near.float().mean().item() == pytest.approx(0.5, abs=0.1)
    torch.testing.assert_close(env.state.prop_qpos[:, 0, 2], torch.full((400,), 0.9, dtype=torch.float64))


@pytest.mark.parametrize("name", ["Strike", "Block"])
def test_the_goal_is_the_same_wherever_the_character_faces(name: str) -> None:
    env = make(name, 1)
    env.state.prop_qvel[0, 0] = torch.tensor([1.0, -2.0, 0.5, 0.3, 0.2, 0.1], dtype=torch.float64)
    before = env.task.goal(env.state).clone()
    turn, shift = 1.1, torch.tensor([2.0, -3.0], dtype=torch.float64)
    c, s = math.cos(turn), math.sin(turn)
    spin = torch.tensor([[c, -s], [s, c]], dtype=torch.float64)
    half = torch.tensor([math.cos(turn / 2), math.sin(turn / 2)], dtype=torch.float64)

    def moved(pose: torch.Tensor) -> torch.Tensor:
        pose = pose.clone()
        pose[:2] = spin @ pose[:2] + shift
        w, x, y, z = pose[3:7].tolist()
        h, k = half.tolist()
        pose[3:7] = torch.tensor([h * w - k * z, h * x - k * y, h * y + k * x, h * z + k * w])
        return pose

    prop, velocity = moved(env.state.prop_qpos[0, 0]), env.state.prop_qvel[0, 0].clone()
    velocity[:2] = spin @ velocity[:2]
    qpos = env.state.qpos[0].clone()
    qpos[:7] = moved(qpos[:7])
    env.physics.write(torch.tensor([0]), qpos[None], torch.zeros(1, env.character.model.nv))
    env.state.prop_qpos[0, 0], env.state.prop_qvel[0, 0] = prop, velocity
    if name == "Block":
        env.task._origin_w[0] = spin @ env.task._origin_w[0] + shift
    torch.testing.assert_close(env.task.goal(env.state), before, atol=1e-5, rtol=0)


def test_a_cube_waits_flies_and_comes_again() -> None:
    env = make("Block", 3, cycle=12, warm_up=5)
    waiting = env.state.prop_qpos[:, 0, :3].clone()
    away = (waiting[:, :2] - env.state.qpos[:, :2]).norm(dim=-1)
    assert ((away >= 1.5) & (away <= 3.0)).all()
    for step in range(1, 12):
        env.step(rest(env))
        speed = env.state.prop_qvel[:, 0, :3].norm(dim=-1)
        if step < 5:
            torch.testing.assert_close(env.state.prop_qpos[:, 0, :3], waiting)
        elif step == 5:
            assert ((speed > 29.0) & (speed < 41.0)).all()
    env.step(rest(env))
    assert (env.state.prop_qpos[:, 0, :3] != waiting).any(-1).all()
    assert not env.state.prop_qvel[:, 0].any()
    assert (env.task.goal(env.state)[:, 0] == 0).all()


def test_block_pays_from_a_hit_on_the_shield_alone_until_the_next_cube() -> None:
    env = make("Block", 3, cycle=6, warm_up=4)
    hit(env, 1, "shield", 5.0)
    hit(env, 2, "shield", 5.0)
    hit(env, 2, "head", 5.0)
    assert env.task.reward(env.state)["block"].tolist() == [0.0, 1.0, 0.0]
    assert env.task.terminated(env.state).tolist() == [False, False, True]
    generator = torch.Generator().manual_seed(0)
    env.task.advance(env.state, generator)
    env.state.hit_force_w.zero_()
    for _ in range(4):
        assert env.task.reward(env.state)["block"].tolist()[:2] == [0.0, 1.0]
        env.task.advance(env.state, generator)
    env.task.advance(env.state, generator)
    assert not env.task.reward(env.state)["block"].any()


def test_block_ends_where_the_character_drifts() -> None:
    env = make("Block", 2)
    env.task._origin_w[1, 0] += 2.1
    assert env.task.terminated(env.state).tolist() == [False, True]


def test_what_is_thrown_reaches_its_target() -> None:
    generator = torch.Generator().manual_seed(0)
    start, target = (
        torch.randn(50, 3, generator=generator).double() * 4.0,
        torch.randn(50, 3, generator=generator).double(),
    )
    velocity = aimed(start, target, (30.0, 40.0), generator)
    time = ((target - start)[:, :2].norm(dim=-1) / velocity[:, :2].norm(dim=-1)).unsqueeze(-1)
    fall = torch.tensor([0.0, 0.0, -9.81], dtype=torch.float64)
    torch.testing.assert_close(start + velocity * time + 0.5 * fall * time**2, target)


def test_recovery_pushes_level_for_half_a_second_and_moves_the_character() -> None:
    env = make("Recovery", 64, boxes=0.0, every=(3, 3))
    env.step(rest(env))
    env.step(rest(env))
    assert env.task.push(env.state) is None or not env.task.push(env.state).any()
    env.step(rest(env))
    lasting, drift = 0, torch.zeros(64)
    env.task.config.every = (100, 100)
    env.task._steps_left.fill_(100)
    while env.task.push(env.state).any():
        force = env.task.push(env.state)
        assert ((force.norm(dim=-1) >= 500.0) & (force.norm(dim=-1) <= 1000.0)).all()
        assert not force[:, 2].any()
        before = env.state.qpos[:, :2].clone()
        env.step(rest(env))
        drift += ((env.state.qpos[:, :2] - before) * force[:, :2]).sum(-1).float().sign()
        lasting += 1
    assert lasting == 15
    assert (drift > 0).float().mean() > 0.95


def test_recovery_throws_both_boxes_at_the_torso() -> None:
    env = make("Recovery", 64, boxes=1.0, every=(2, 2))
    env.step(rest(env))
    before = env.state.prop_qpos[:, :, 0] == 50.0
    assert before.all()
    env.step(rest(env))
    thrown = env.state.prop_qpos[:, :, 0] != 50.0
    assert (thrown.sum(-1) == 1).all()
    assert thrown.any(0).all()
    torso = env.character.bodies.index("torso")
    for box in range(2):
        way = env.state.body_pos_w[:, torso] - env.state.prop_qpos[:, box, :3]
        distance = way[thrown[:, box]].norm(dim=-1)
        assert ((distance > 3.9) & (distance < 5.1)).all()
    env.task._steps_left.fill_(100)
    felt = torch.zeros(64, dtype=torch.bool)
    for _ in range(6):
        env.step(rest(env))
        felt |= (env.state.hit_force_w.abs() > 1.0).flatten(1).any(-1)
    assert felt.float().mean() > 0.9


def test_recovery_begins_with_both_boxes_in_the_air_and_keeps_them_there_until_they_fly() -> None:
    env = make("Recovery", 8, boxes=1.0, every=(4, 4))
    begin = env.state.prop_qpos.clone()
    for _ in range(3):
        env.step(rest(env))
        assert torch.equal(env.state.prop_qpos, begin)
    env.step(rest(env))
    thrown = (env.state.prop_qpos != begin).any(-1)
    assert (thrown.sum(-1) == 1).all()
    env.step(rest(env))
    assert torch.equal(env.state.prop_qpos[~thrown], begin[~thrown])
    env.reset(options={"reset_mask": torch.arange(8) < 4, "start": "default"})
    assert torch.equal(env.state.prop_qpos[:4], begin[:4])
    assert (env.state.prop_qpos[4:] != begin[4:])[thrown[4:]].any(-1).all()


def test_recovery_pays_for_root_and_head_up() -> None:
    env = make("Recovery", 2)
    assert env.task.reward(env.state)["standing"].tolist() == [1.0, 1.0]
    low = env.state.qpos.clone()
    low[1, 2] -= 0.6
    env.physics.write(torch.arange(2), low, torch.zeros(2, env.character.model.nv))
    assert env.task.reward(env.state)["standing"].tolist() == [1.0, 0.0]


@pytest.mark.parametrize("name", ["Strike", "Block", "Recovery"])
def test_a_resumed_environment_goes_on_alike(name: str) -> None:
    fast = {"Block": {"cycle": 6, "warm_up": 2}, "Recovery": {"every": (2, 4)}}.get(name, {})
    one, other = make(name, 3, **fast), make(name, 3, **fast)
    generator = torch.Generator().manual_seed(1)
    actions = 0.3 * torch.randn(12, 3, 31, generator=generator)
    for action in actions[:5]:
        one.step(action)
    other.load_state_dict(one.state_dict())
    for action in actions[5:]:
        (seen, reward, *_), (seen_too, reward_too, *_) = one.step(action), other.step(action)
        assert (reward == reward_too).all()
        assert all((seen[key] == seen_too[key]).all() for key in seen)
    assert torch.equal(one.state.prop_qpos, other.state.prop_qpos)


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("Strike", {"form": "cod"}, "task.form=cod"),
        ("Strike", {"near_distance": (2.0, 1.0)}, "task.near_distance"),
        ("Block", {"warm_up": 80}, "task.warm_up=80"),
        ("Block", {"drift": 0.0}, "task.drift"),
        ("Recovery", {"force": (-1.0, 5.0)}, "task.force"),
        ("Recovery", {"forces": 1.0}, "task.forces: no such argument; did you mean task.force"),
    ],
)  # fmt: skip
def test_arguments_that_cannot_be(name: str, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(SuiteError, match=words) as refused:
        make_task(name, **arguments)
    assert "\n" not in str(refused.value)
