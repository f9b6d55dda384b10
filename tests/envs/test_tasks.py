"""Tasks with a goal and no props: what they reward, how goals are drawn, and where that does not depend."""

from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.registration import make_task
from murmillo.envs.rotations import quat_mul
from murmillo.envs.tasks import TASKS
from murmillo.envs.tasks.goals import GoalTask

NAMES = [name for name, cls in TASKS.items() if issubclass(cls, GoalTask)]
HELD = [name for name in NAMES if name != "PathFollow"]


@lru_cache
def world(num_envs: int) -> HumanoidVectorEnv:
    """Worlds that any task can be put into."""
    env = gymnasium.make_vec("murmillo/Imitation-v0", num_envs=num_envs, threads=1)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def stage(name: str, num_envs: int = 1, task: dict[str, Any] | None = None) -> HumanoidVectorEnv:
    """Standing characters with this task, the same worlds each time."""
    env = world(num_envs)
    env.task = make_task(name, **task or {})
    env.task.bind(num_envs, env.character)
    env.reset(seed=0, options={"start": "default"})
    return env


def make(name: str, num_envs: int, task: dict[str, Any] | None = None, **kwargs: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec(f"murmillo/{name}-v0", num_envs=num_envs, threads=1, task=task, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def drawn(env: HumanoidVectorEnv, n: int = 2000) -> dict[str, Tensor]:
    """Many goals of world 0."""
    ids = torch.zeros(n, dtype=torch.int64)
    return goal_task(env).draw(ids, env.state, torch.Generator().manual_seed(0))


def goal_task(env: HumanoidVectorEnv) -> GoalTask:
    assert isinstance(env.task, GoalTask)
    return env.task


def place(env: HumanoidVectorEnv, xy=(0.0, 0.0), yaw: float = 0.0, velocity=(0.0, 0.0)) -> None:
    """Stand at xy [m], turned by yaw [rad], moving at velocity [m/s]."""
    qpos, qvel = env.state.qpos.clone(), torch.zeros_like(env.state.qvel)
    qpos[:, :2], qvel[:, :2] = torch.tensor(xy), torch.tensor(velocity)
    qpos[:, 3:7] = yaw_quat(yaw)
    env.physics.write(torch.arange(env.num_envs), qpos, qvel)


def yaw_quat(yaw: float) -> Tensor:
    return torch.tensor([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)], dtype=torch.float64)


def set_goals(env: HumanoidVectorEnv, **goals: Any) -> None:
    for name, value in goals.items():
        goal_task(env).goals[name][:] = torch.as_tensor(value, dtype=torch.float64)


def rewards(env: HumanoidVectorEnv) -> dict[str, float]:
    """The terms in world 0."""
    return {name: term[0].item() for name, term in env.task.reward(env.state).items()}


def test_every_task_without_props_is_tested_here():
    assert {"Reach", "Speed", "Steering", "Location", "Direction", "Relocation", "PathFollow", "Navigate"} <= set(NAMES)


# --- rewards, by hand ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("form", "scale"), [("paper", 5.0), ("code", 4.0)])
def test_reach_rewards_the_nearness_of_the_swords_tip(form, scale):
    env = stage("Reach", task={"form": form})
    tip = env.state.key_pos_w[0, env.character.key_bodies.index("sword")]
    set_goals(env, target_w=tip + torch.tensor([0.0, 0.1, -0.2]))
    assert rewards(env) == {"position": pytest.approx(np.exp(-scale * 0.05))}


def test_calms_reach_is_asess_with_a_scale_of_4():
    env = stage("Reach", task={"scale": 4.0})
    tip = env.state.key_pos_w[0, env.character.key_bodies.index("sword")]
    set_goals(env, target_w=tip + torch.tensor([0.5, 0.0, 0.0]))
    assert rewards(env) == {"position": pytest.approx(np.exp(-1.0))}


def test_speed_counts_along_the_direction_only():
    env = stage("Speed")
    place(env, velocity=(5.0, 1.0))
    set_goals(env, direction_w=[0.0, 1.0], speed=3.0)
    assert rewards(env) == {"velocity": pytest.approx(np.exp(-1.0))}


@pytest.mark.parametrize("name", ["Steering", "Direction"])
def test_steering_adds_a_facing_of_its_own(name):
    env = stage(name)
    place(env, yaw=np.pi / 3, velocity=(1.0, 0.5))
    set_goals(env, direction_w=[0.0, 1.0], speed=1.5, facing_w=[1.0, 0.0])
    assert rewards(env) == {"velocity": pytest.approx(0.7 * np.exp(-0.25)), "facing": pytest.approx(0.15)}
    place(env, yaw=np.pi, velocity=(0.0, -0.5))
    assert rewards(env) == {"velocity": pytest.approx(0.7 * np.exp(-1.0)), "facing": pytest.approx(-0.3)}


def test_steering_as_published_has_a_term_aside_and_no_reward_below_zero():
    env = stage("Steering", task={"form": "code"})
    set_goals(env, direction_w=[0.0, 1.0], speed=1.5, facing_w=[1.0, 0.0])
    place(env, velocity=(1.0, 0.5))
    assert rewards(env) == {"velocity": pytest.approx(0.7 * np.exp(-0.275)), "facing": pytest.approx(0.3)}
    place(env, yaw=np.pi, velocity=(0.0, -0.5))
    assert rewards(env) == {"velocity": 0.0, "facing": 0.0}


def test_location_rewards_nearness_over_the_ground():
    env = stage("Location")
    place(env, xy=(1.0, 2.0))
    set_goals(env, target_w=[1.6, 2.8])
    assert rewards(env) == {"position": pytest.approx(np.exp(-0.5))}


def test_location_as_published_also_rewards_going_and_looking_there():
    env = stage("Location", task={"form": "code"})
    set_goals(env, target_w=[1.6, 2.8])

    def terms(**how: Any) -> list[float]:
        place(env, **how)
        return [rewards(env)[name] for name in ("position", "velocity", "facing")]

    slow = terms(xy=(1.0, 2.0), velocity=(0.3, 0.4))
    assert slow == pytest.approx([0.5 * np.exp(-0.5), 0.4 * np.exp(-1.0), 0.06])
    assert terms(xy=(1.0, 2.0), velocity=(3.0, 4.0))[1] == pytest.approx(0.4)  # faster than 1 m/s is no worse
    assert terms(xy=(1.0, 2.0), yaw=np.pi, velocity=(-0.3, -0.4))[1:] == [0.0, 0.0]
    assert terms(xy=(1.6, 2.2), yaw=np.pi)[1:] == pytest.approx([0.4, 0.1])  # there, 0.6 m off: d² < 0.5


def test_relocation_is_the_papers_up_to_the_farthest_target():
    env = stage("Relocation")
    set_goals(env, target_w=[0.0, 2.0])
    place(env)
    assert rewards(env) == {"position": pytest.approx(-2.0)}
    place(env, xy=(14.0, 2.0))
    assert rewards(env) == {"position": pytest.approx(-98.0)}
    place(env, xy=(500.0, 0.0))
    assert rewards(env) == {"position": pytest.approx(-100.0)}


def test_alive_lifts_relocation_and_its_range():
    env = stage("Relocation", task={"alive": 100.0})
    set_goals(env, target_w=[0.0, 2.0])
    place(env)
    assert rewards(env) == {"position": pytest.approx(-2.0), "alive": 100.0}
    assert env.task.reward_range == pytest.approx((0.0, 100.0))


def test_path_follow_rewards_speed_towards_the_point_ahead_and_nearness_to_the_path():
    env = stage("PathFollow", task={"points": [(0.0, 0.0), (10.0, 0.0)], "spline": False})
    set_goals(env, arc=2.0, speed=2.0)
    origin = goal_task(env).goals["path_w"][0, 0].tolist()
    place(env, xy=(origin[0] + 2.0, origin[1] + 0.5), velocity=(np.sqrt(1.25), 0.0))
    # the point ahead lies 1 m on and 0.5 m aside, so the speed towards it is 1
    assert rewards(env) == {
        "velocity": pytest.approx(0.7 * np.exp(-0.25)),
        "on_path": pytest.approx(0.3 * np.exp(-0.5)),
    }


# --- the range that returns are normalised by ------------------------------------------------------------------------


def reach_best(env: HumanoidVectorEnv) -> None:
    tip = env.state.key_pos_w[:, env.character.key_bodies.index("sword")]
    qpos = env.state.qpos.clone()
    qpos[:, :3] += goal_task(env).goals["target_w"] - tip
    env.physics.write(torch.arange(env.num_envs), qpos, torch.zeros_like(env.state.qvel))


def stand_on_target(env: HumanoidVectorEnv) -> None:
    place(env, xy=goal_task(env).goals["target_w"][0].tolist())


def run_away(env: HumanoidVectorEnv) -> None:
    """Far from the target, heading off."""
    target = goal_task(env).goals["target_w"][0]
    place(env, xy=(target[0].item() + 30.0, target[1].item()), velocity=(9.0, 0.0))


def move_by_goal(env: HumanoidVectorEnv, sign: float = 1.0) -> None:
    """At the target's speed and facing; with sign -1 at ten metres a second the other way, facing away."""
    goals = {name: goal[0] for name, goal in goal_task(env).goals.items()}
    face = goals.get("facing_w", goals["direction_w"]) * sign
    speed = goals["speed"] if sign > 0 else 10.0
    yaw = torch.atan2(face[1], face[0]).item()
    place(env, yaw=yaw, velocity=(sign * speed * goals["direction_w"]).tolist())


def move_against_goal(env: HumanoidVectorEnv) -> None:
    move_by_goal(env, -1.0)


def follow(env: HumanoidVectorEnv) -> None:
    """On the path, moving towards the point ahead."""
    place(env, xy=goal_task(env).goals["path_w"][0, 0].tolist())
    to_point = env.task.goal(env.state)[0, :2]
    direction = to_point / to_point.norm()
    velocity = goal_task(env).goals["speed"][0] * direction
    place(env, xy=goal_task(env).goals["path_w"][0, 0].tolist(), velocity=velocity.tolist())


def leave(env: HumanoidVectorEnv) -> None:
    """Ten metres off the path and going on."""
    x, y = goal_task(env).goals["path_w"][0, 0].tolist()
    place(env, xy=(x - 10.0, y), velocity=(-9.0, 0.0))


BEST_AND_WORST = {
    "Reach": (reach_best, run_away),
    "Speed": (move_by_goal, move_against_goal),
    "Steering": (move_by_goal, move_against_goal),
    "Location": (stand_on_target, run_away),
    "Direction": (move_by_goal, move_against_goal),
    "Relocation": (stand_on_target, run_away),
    "PathFollow": (follow, leave),
    "Navigate": (stand_on_target, run_away),
}


@pytest.mark.parametrize(
    ("name", "form"),
    [*((name, None) for name in NAMES), ("Reach", "code"), ("Steering", "code"), ("Location", "code")],
)
def test_the_reward_reaches_both_ends_of_its_range_and_no_further(name, form):
    env = stage(name, 16, task=form and {"form": form})
    low, high = env.task.reward_range
    for extreme, bound in zip(BEST_AND_WORST[name], (high, low), strict=True):
        extreme(env)
        assert sum(rewards(env).values()) == pytest.approx(bound, abs=1e-5)
    generator = np.random.default_rng(0)
    for _ in range(60):
        reward = env.step(generator.uniform(-1, 1, (16, 31)).astype(np.float32))[1]
        assert low - 1e-6 <= reward.min() <= reward.max() <= high + 1e-6


# --- place and heading -----------------------------------------------------------------------------------------------


def views(env: HumanoidVectorEnv) -> list[Tensor]:
    """Goals as observed, and each term of the reward."""
    return [env.task.goal(env.state), *env.task.reward(env.state).values()]


def move_the_world(env: HumanoidVectorEnv, yaw: float, shift: tuple[float, float]) -> None:
    """Turn the characters and their goals about the origin and shift them over the ground."""
    turn = torch.tensor([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    qpos, qvel, by = env.state.qpos.clone(), env.state.qvel.clone(), torch.tensor(shift)
    qpos[:, :2], qvel[:, :2] = qpos[:, :2] @ turn.T + by, qvel[:, :2] @ turn.T
    qpos[:, 3:7] = quat_mul(yaw_quat(yaw), qpos[:, 3:7])
    env.physics.write(torch.arange(env.num_envs), qpos, qvel)
    for name, goal in goal_task(env).goals.items():
        if name.endswith("_w"):
            goal[..., :2] = goal[..., :2] @ turn.T + (0.0 if name in ("direction_w", "facing_w") else by)


@pytest.mark.parametrize(
    ("name", "task", "invariant"),
    [
        *((name, {}, True) for name in NAMES),
        ("Location", {"form": "code"}, True),
        ("Reach", {"form": "code"}, False),  # the root is not subtracted
        ("Steering", {"form": "code"}, False),  # the sum of x and y of the speed aside
    ],
)
def test_goals_and_rewards_depend_on_neither_place_nor_heading(name, task, invariant):
    env = stage(name, 16, task=task)
    for step in range(15):
        env.step(np.random.default_rng(step).uniform(-0.5, 0.5, (16, 31)).astype(np.float32))
    before = views(env)
    move_the_world(env, yaw=2.1, shift=(7.0, -3.0))
    same = [torch.allclose(a, b, atol=1e-5) for a, b in zip(before, views(env), strict=True)]
    assert all(same) is invariant


def test_a_goal_is_seen_from_where_the_character_looks():
    env = stage("Location")
    set_goals(env, target_w=[1.0, 5.0])
    place(env, xy=(1.0, 2.0), yaw=np.pi / 2)
    assert env.task.goal(env.state)[0].tolist() == pytest.approx([3.0, 0.0], abs=1e-6)
    env = stage("Steering")
    set_goals(env, direction_w=[0.0, 1.0], speed=1.5, facing_w=[1.0, 0.0])
    place(env, yaw=np.pi / 2)
    assert env.task.goal(env.state)[0].tolist() == pytest.approx([1.0, 0.0, 1.5, 0.0, -1.0], abs=1e-6)
    env = stage("Reach")
    place(env, xy=(3.0, 3.0), yaw=np.pi)
    set_goals(env, target_w=[3.0, 2.5, 1.0])
    seen = env.task.goal(env.state)[0].tolist()
    assert seen == pytest.approx([0.0, 0.5, 1.0 - env.state.qpos[0, 2].item()], abs=1e-6)


def test_a_path_is_laid_ahead_of_the_character():
    env = stage("PathFollow", task={"points": [(0.0, 0.0), (10.0, 0.0)], "lookahead": [1.0, 3.0], "speed": [2.0, 2.0]})
    place(env, xy=(4.0, 1.0), yaw=1.0)
    env.task.reset(torch.tensor([0]), env.state, torch.Generator())
    assert env.task.goal(env.state)[0].tolist() == pytest.approx([1.0, 0.0, 3.0, 0.0, 2.0], abs=1e-6)


# --- drawing ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", HELD)
def test_goals_hold_for_the_published_times(name):
    published = {"Reach": (50, 100), "Navigate": (90, 149)}.get(name, (100, 200))
    assert goal_task(stage(name)).hold_steps == published


@pytest.mark.parametrize("name", HELD)
def test_goals_hold_for_every_number_of_steps_between_two(name):
    env = stage(name, 64, task={"hold_steps": [3, 5]})
    task, generator = goal_task(env), torch.Generator().manual_seed(0)
    goal = next(iter(task.goals))
    changed, last = [], task.goals[goal].clone()
    for _ in range(60):
        task.advance(env.state, generator)
        changed.append((task.goals[goal] != last).flatten(1).any(-1))
        last = task.goals[goal].clone()
    lengths = {int(length) for world in torch.stack(changed).T for length in world.nonzero().squeeze(-1).diff()}
    assert lengths == {3, 4, 5}


def test_goals_are_drawn_from_the_whole_of_their_ranges():
    env = stage("Location")
    place(env, xy=(100.0, 50.0))
    offset = drawn(env)["target_w"] - torch.tensor([100.0, 50.0])
    assert offset.abs().max() <= 10.0
    assert offset.std(0).tolist() == pytest.approx([10.0 / 3**0.5] * 2, rel=0.05)
    for name, top in (("Speed", 7.0), ("Direction", 5.0)):
        goals = drawn(stage(name))
        assert 0.0 <= goals["speed"].min() < 0.02 * top < 0.98 * top < goals["speed"].max() <= top
        assert goals["direction_w"].norm(dim=-1).sub(1.0).abs().max() < 1e-12
        assert goals["direction_w"].mean(0).abs().max() < 0.06
    steering = drawn(stage("Steering"))
    assert (steering["speed"] == 1.5).all()
    assert (steering["direction_w"] * steering["facing_w"]).sum(-1).mean().abs() < 0.06
    published = drawn(stage("Steering", task={"form": "code"}))["speed"]
    assert 1.5 <= published.min() < published.max() <= 1.6


@pytest.mark.parametrize("form", ["paper", "code"])
def test_reach_draws_around_the_root_and_as_published_around_the_world(form):
    env = stage("Reach", task={"form": form})
    place(env, xy=(100.0, 50.0))
    target = drawn(env)["target_w"]
    assert target[:, 2].min() >= 0.2
    assert target[:, 2].max() <= 2.0
    if form == "paper":
        distance = (target - env.state.qpos[:, :3]).norm(dim=-1)
        assert distance.max() <= 1.0
        assert (distance < 0.5).double().mean() == pytest.approx(1 / 8, abs=0.03)  # even over the ball
    else:
        assert target[:, :2].abs().max() <= 1.0
        assert target[:, :2].std(0).tolist() == pytest.approx([1.0 / 3**0.5] * 2, rel=0.05)


def test_skills_are_commanded_anew_every_five_steps():
    for name in ("Direction", "Relocation", "PathFollow"):
        env = stage(name, 32)
        skills = [env.observation()["skill"]]
        for _ in range(11):
            skills.append(env.step(np.zeros((32, 31), np.float32))[0]["skill"])
        changes = [step for step in range(1, 12) if (skills[step] != skills[step - 1]).any()]
        assert changes == [5, 10]


# --- following a path ------------------------------------------------------------------------------------------------


def test_walking_along_a_path_brings_its_points_nearer_and_never_back():
    env = stage("PathFollow", 4)
    task, generator = goal_task(env), torch.Generator()
    path = task.goals["path_w"].clone()
    for step in range(1, 40):
        qpos = env.state.qpos.clone()
        qpos[:, :2] = path[:, 2 * step]  # 0.2 m a step
        env.physics.write(torch.arange(4), qpos, torch.zeros_like(env.state.qvel))
        task.advance(env.state, generator)
        assert task.goals["arc"].tolist() == pytest.approx([0.2 * step] * 4, abs=1e-9)
        assert rewards(env)["on_path"] == pytest.approx(0.3)
    qpos[:, :2] = path[:, 0]
    env.physics.write(torch.arange(4), qpos, torch.zeros_like(env.state.qvel))
    task.advance(env.state, generator)
    assert task.goals["arc"].tolist() == pytest.approx([7.8] * 4)
    assert rewards(env)["on_path"] < 0.01


# --- in the environment ----------------------------------------------------------------------------------------------


def rollout(env: HumanoidVectorEnv, steps: range) -> list[np.ndarray]:
    seen = []
    for step in steps:
        action = np.random.default_rng(step).uniform(-0.5, 0.5, env.action_space.shape or ()).astype(np.float32)
        obs, reward, terminated, truncated, _ = env.step(action)
        seen += [obs["goal"], obs["state"], obs["skill"], reward, terminated, truncated]
    return seen


@pytest.mark.parametrize("name", NAMES)
def test_a_seed_decides_everything_and_a_state_continues_bit_for_bit(name):
    short = {} if name == "PathFollow" else {"hold_steps": [3, 6]}
    one, other = (make(name, 3, task=short, episode_steps=9) for _ in range(2))
    for env in (one, other):
        env.reset(seed=7)
    first = rollout(one, range(12))
    assert all(map(np.array_equal, first, rollout(other, range(12))))
    one.reset(seed=8)
    assert not all(map(np.array_equal, first, rollout(one, range(12))))
    kept = one.state_dict()
    ahead = rollout(one, range(20, 40))
    other.load_state_dict(kept)
    assert all(map(np.array_equal, ahead, rollout(other, range(20, 40))))
    one.load_state_dict(kept)  # what was kept did not move with the environment
    assert all(map(np.array_equal, ahead, rollout(one, range(20, 40))))


@pytest.mark.parametrize("name", NAMES)
def test_markers_show_the_goal(name):
    env = stage(name, 2)
    shown = env.task.markers(env.state, 1)
    assert shown
    numbers = [n for marker in shown for n in (*marker.pos_w, *(marker.direction_w or ()), marker.size, *marker.rgba)]
    assert np.isfinite(numbers).all()
    goals = goal_task(env).goals
    if "target_w" in goals:
        assert list(shown[0].pos_w[:2]) == goals["target_w"][1, :2].tolist()
    if "facing_w" in goals:
        assert [list(marker.direction_w or ())[:2] for marker in shown] == [
            goals["direction_w"][1].tolist(),
            goals["facing_w"][1].tolist(),
        ]


@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        ("Reach", {"radius": -1.0}, "task.radius=-1.0: needs a number above 0"),
        ("Reach", {"radius": float("nan")}, "task.radius=nan"),
        ("Reach", {"height": (2.0, 0.2)}, r"task.height=\(2.0, 0.2\): needs two numbers of at least 0"),
        ("Reach", {"scale": 0.0}, "task.scale=0.0: needs a number above 0"),
        ("Reach", {"key_body": "tail"}, "task.key_body=tail: no such key point; there are: right_hand"),
        ("Reach", {"hold_steps": (0, 5)}, r"task.hold_steps=\(0, 5\): needs two whole numbers of at least 1"),
        ("Reach", {"hold_steps": (1.5, 5)}, "task.hold_steps"),
        ("Location", {"form": "papr"}, "task.form=papr: no such choice; there are: paper, code"),
        ("Location", {"radius": "far"}, "task.radius=far"),
        ("Location", {"raduis": 3.0}, "task.raduis: no such argument; did you mean task.radius"),
        ("Speed", {"speed": (-1.0, 2.0)}, "task.speed"),
        ("Speed", {"speed": 3.0}, "task.speed=3.0: needs two numbers"),
        ("Speed", {"hold_steps": (200, 100)}, "task.hold_steps"),
        ("Steering", {"form": "cod"}, "task.form=cod"),
        ("Steering", {"speed": ()}, "task.speed"),
        ("Direction", {"skill_steps": -1}, "task.skill_steps=-1: needs a whole number"),
        ("Direction", {"speed": (5.0, 0.0)}, "task.speed"),
        ("Relocation", {"alive": -0.1}, "task.alive=-0.1: needs a number of at least 0"),
        ("Relocation", {"radius": 0}, "task.radius=0"),
        ("PathFollow", {"lookahead": ()}, r"task.lookahead=\(\): needs one or more numbers above 0"),
        ("PathFollow", {"lookahead": (1.0, -2.0)}, "task.lookahead"),
        ("PathFollow", {"bend_radius": 0.0}, "task.bend_radius=0.0"),
        ("PathFollow", {"points": [(0.0, 0.0)]}, "task.points: needs two or more points"),
        ("PathFollow", {"points": [(0.0, 0.0), (1.0, 1.0, 1.0)]}, "task.points"),
        ("PathFollow", {"points": [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0)]}, "task.points: points 1 and 2 are the same"),
    ],
)
def test_arguments_that_cannot_be_are_named_in_one_line(name, arguments, message):
    with pytest.raises(SuiteError, match=message) as caught:
        stage(name, task=arguments)
    assert "\n" not in str(caught.value)


def test_arguments_may_come_as_lists():
    speed = drawn(stage("Speed", task={"speed": [1, 2], "hold_steps": [10, 20]}))["speed"]
    assert 1.0 <= speed.min() < speed.max() <= 2.0
