"""Navigate: its goal and reward by hand, what ends an episode, and the settings of its id."""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.tasks.navigate import Navigate

DT = 1.0 / 30.0


def make(num_envs: int = 4, task: dict[str, Any] | None = None, **kwargs: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec("murmillo/Navigate-v0", num_envs=num_envs, threads=1, task=task, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    env.reset(seed=0)
    return env


def navigate(env: HumanoidVectorEnv) -> Navigate:
    assert isinstance(env.task, Navigate)
    return env.task


def place(env: HumanoidVectorEnv, xy: tuple[float, float], yaw: float = 0.0) -> None:
    qpos = env.character.default_qpos.repeat(env.num_envs, 1)
    qpos[:, :2] = torch.tensor(xy)
    qpos[:, 3], qpos[:, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
    env.physics.write(torch.arange(env.num_envs), qpos, torch.zeros_like(env.state.qvel))


def aim(env: HumanoidVectorEnv, target, steps: int, came_from=(0.0, 0.0)) -> None:
    task = navigate(env)
    task.goals["target_w"][:] = torch.tensor(target, dtype=torch.float64)
    task.goals["from_w"][:] = torch.tensor(came_from, dtype=torch.float64)
    task._steps_left[:] = steps


def reward(env: HumanoidVectorEnv) -> float:
    return navigate(env).reward(env.state)["velocity"][0].item()


def test_the_id_has_the_published_settings() -> None:
    env = make()
    assert env.character.name == "humanoid"
    assert env.action_space.shape == (4, 28)
    assert isinstance(env.single_observation_space, gymnasium.spaces.Dict)
    shapes = {name: space.shape for name, space in env.single_observation_space.items()}
    assert shapes == {"state": (4, 195), "length": (), "window": (5, 105), "goal": (4,), "skill": ()}
    assert env.config.episode_steps == 500
    assert env.config.fall.heights == {}


def test_settings_of_the_id_may_be_told_otherwise() -> None:
    env = make(episode_steps=7, fall={"force": 2.0}, character="sword_shield", features="character", window=1)
    assert (env.config.episode_steps, env.config.fall.force, env.config.fall.same_body) == (7, 2.0, True)
    assert env.action_space.shape == (4, 31)
    assert set(env.observation()) == {"state", "skill", "goal"}


def test_the_goal_is_way_speed_and_distance() -> None:
    env = make()
    place(env, (1.0, 2.0), yaw=np.pi / 2)
    aim(env, (1.0, 4.4), steps=60)
    assert navigate(env).goal(env.state)[0].tolist() == pytest.approx([1.0, 0.0, 1.2, 0.8], abs=1e-6)
    aim(env, (-8.0, 2.0), steps=60)
    assert navigate(env).goal(env.state)[0].tolist() == pytest.approx([0.0, 1.0, 1.5, 1.5], abs=1e-6)


def test_the_reward_is_for_the_velocity_of_the_step() -> None:
    env = make()
    aim(env, (3.9, 0.0), steps=90)  # 1.3 m/s
    for speed in (1.3, 0.0, 2.0):
        place(env, (speed * DT, 0.0))
        assert reward(env) == pytest.approx(np.exp(-3.0 * (speed - 1.3) ** 2 / 1.3**2))
    place(env, (0.0, 1.3 * DT))
    assert reward(env) == pytest.approx(np.exp(-6.0))


def test_the_wanted_speed_is_bounded_by_the_gait_and_by_the_way_left() -> None:
    env = make()
    aim(env, (0.9, 0.0), steps=90)  # 0.3 m/s would do
    place(env, (1.2 * DT, 0.0))
    assert reward(env) == pytest.approx(1.0)
    aim(env, (9.0, 0.0), steps=90)  # 3 m/s would be needed
    place(env, (1.5 * DT, 0.0))
    assert reward(env) == pytest.approx(1.0)
    env = make(task={"radius": 0.0})
    aim(env, (0.02, 0.0), steps=90)  # nearer than a step at 1.2 m/s
    place(env, (0.02, 0.0))
    assert reward(env) == pytest.approx(1.0)
    place(env, (1.2 * DT, 0.0))
    assert reward(env) == pytest.approx(np.exp(-3.0))


def test_a_step_is_rewarded_from_where_the_policy_acted() -> None:
    env = make(8)
    for step in range(3):
        before, target = env.state.qpos[:, :2].clone(), navigate(env).goals["target_w"].clone()
        left = navigate(env)._steps_left * DT
        _, rewards, _, _, info = env.step(np.full((8, 28), 0.05 * step, np.float32))
        assert not info["_final_obs"].any()
        way = target - before
        wanted = (way.norm(dim=-1) / left).clamp(1.2, 1.5).unsqueeze(-1)
        error = (env.state.qpos[:, :2] - before) / DT - wanted * way / way.norm(dim=-1, keepdim=True)
        expected = torch.exp(-3.0 * error.square().sum(-1) / wanted.squeeze(-1).square())
        near = (target - env.state.qpos[:, :2]).norm(dim=-1) < 0.5
        np.testing.assert_allclose(rewards, expected.masked_fill(near, 1.0).numpy(), atol=1e-5)


def test_near_the_target_the_reward_is_full() -> None:
    env = make()
    aim(env, (5.0, 0.0), steps=90, came_from=(4.6, 0.0))
    place(env, (4.6, 0.0))
    assert reward(env) == 1.0
    place(env, (4.4, 0.0))
    assert reward(env) < 0.1


def test_an_episode_ends_where_the_target_is_three_metres_farther_than_when_drawn() -> None:
    env = make()
    aim(env, (2.0, 0.0), steps=90)
    navigate(env).goals["distance"][:] = 2.0
    for x, ends in ((-2.9, False), (-3.1, True)):
        place(env, (x, 0.0))
        assert navigate(env).terminated(env.state).all() == ends


@pytest.mark.parametrize(
    ("gait", "steps", "speeds", "mean"), [("walk", (90, 149), (0.0, 1.25), 0.928), ("run", (60, 89), (1.0, 3.0), 1.641)]
)
def test_targets_lie_as_far_as_their_time_lets_one_come(gait, steps, speeds, mean) -> None:
    """The means are those of the normal distributions cut off at both ends."""
    env = make(task={"gait": gait})
    task, generator = navigate(env), torch.Generator().manual_seed(0)
    place(env, (7.0, 7.0))
    ids = torch.arange(4)
    drawn = []
    for _ in range(600):
        task.reset(ids, env.state, generator)
        way = task.goals["target_w"] - torch.tensor([7.0, 7.0])
        drawn.append(torch.cat((way, task._steps_left.unsqueeze(-1)), dim=-1))
        torch.testing.assert_close(task.goals["distance"], way.norm(dim=-1))
    way, left = torch.cat(drawn).split([2, 1], dim=-1)
    speed = way.norm(dim=-1) / (left.squeeze(-1) * DT)
    assert (left.min().item(), left.max().item()) == steps
    assert speeds[0] <= speed.min()
    assert speed.max() <= speeds[1] + 1e-9
    assert speed.mean().item() == pytest.approx(mean, abs=0.02)
    assert torch.nn.functional.normalize(way, dim=-1).mean(0).abs().max() < 0.06


def test_targets_lie_to_either_side_of_the_heading_as_far_as_turn_says() -> None:
    env = make(2048, task={"turn": 60.0})
    task = navigate(env)
    place(env, (1.0, 2.0), yaw=2.5)
    task.reset(torch.arange(env.num_envs), env.state, torch.Generator().manual_seed(0))
    way = task.goals["target_w"] - torch.tensor([1.0, 2.0], dtype=torch.float64)
    angle = torch.rad2deg(torch.atan2(way[:, 1], way[:, 0]) - 2.5 + torch.pi).remainder(360.0) - 180.0
    assert angle.abs().max() <= 60.0 + 1e-6
    assert angle.std().item() == pytest.approx(120.0 / 12**0.5, rel=0.05)  # an even spread
    assert angle.mean().abs() < 3.0


def test_a_commanded_target_holds_and_asks_for_the_mean_speed() -> None:
    env = make()
    task = navigate(env)
    target = torch.tensor([[30.0, 0.0]], dtype=torch.float64).repeat(4, 1) + env.state.qpos[:, :2]
    task.command(torch.arange(4), target_w=target)
    for _ in range(3):
        obs, *_ = env.step(np.zeros((4, 28), np.float32))
    assert torch.equal(task.goals["target_w"], target)
    assert obs["goal"][:, 2].tolist() == pytest.approx([1.0] * 4)
    assert not task.terminated(env.state).any()


def test_a_fall_needs_a_low_body_that_is_touched_itself() -> None:
    env = make(2)
    state, bodies = env.state, env.character.bodies
    force, pos = torch.zeros_like(state.ground_force_w), torch.ones_like(state.body_pos_w)
    head, hand, foot = (bodies.index(name) for name in ("head", "left_hand", "left_foot"))

    def falls() -> list[bool]:
        return env._fallen(type(state)(**{**vars(state), "ground_force_w": force, "body_pos_w": pos})).tolist()

    pos[0, hand, 2], force[0, head, 0] = 0.1, 5.0
    pos[1, foot, 2], force[1, foot, 2] = 0.05, 400.0
    assert falls() == [False, False]
    force[0, hand, 2] = 0.9
    assert falls() == [False, False]
    force[0, hand, 2] = 1.1
    assert falls() == [True, False]


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"gait": "hop"}, "task.gait=hop: no such choice; there are: walk, run"),
        ({"speed": 0.0}, "task.speed=0.0: needs a number above 0"),
        ({"speed_range": (2.0, 1.0)}, "task.speed_range"),
        ({"wanted": (0.0, 1.0)}, "task.wanted"),
        ({"hold_steps": (0, 3)}, "task.hold_steps"),
        ({"detour": -1.0}, "task.detour=-1.0"),
        ({"turn": 0.0}, "task.turn=0.0: needs a number above 0 up to 180"),
        ({"turn": 270}, "task.turn=270: needs a number above 0 up to 180"),
    ],
)
def test_arguments_that_cannot_be_are_named(task, message) -> None:
    with pytest.raises(SuiteError, match=message) as caught:
        make(task=task)
    assert "\n" not in str(caught.value)
