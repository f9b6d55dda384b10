"""What a learner may ask of the episodes to come, and what the environment says of residual forces."""

from typing import Any, Literal

import gymnasium
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.character import load_character
from murmillo.envs.residual import ResidualForces

FALLING = {"starts": {"fallen": 1.0, "recovery": 1.0}}


def make(num_envs: int, **kwargs: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec("murmillo/Imitation-v0", num_envs=num_envs, threads=1, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def test_labels_of_new_episodes_follow_the_weights():
    env = make(200, starts={"fallen": 0.0, "recovery": 0.0})
    weights = torch.zeros(len(env.skills))
    weights[[2, 5]] = torch.tensor([1.0, 3.0])
    env.set_skill_weights(weights)
    skill = env.reset(seed=0)[0]["skill"]
    assert set(skill) == {2, 5}
    assert (skill == 5).mean() == pytest.approx(0.75, abs=0.1)
    env.set_skill_weights(None)
    assert len(set(env.reset(seed=0)[0]["skill"])) == len(env.skills)


@pytest.mark.parametrize(("share", "own"), [(0.0, 1 / 3), (0.5, 2 / 3), (1.0, 1.0)])
def test_a_share_of_the_starts_is_commanded_what_its_clip_shows(share: float, own: float):
    clips = ("guard", "idle_alert", "walk_forward")
    env = make(400, clips=clips, starts={"reference": 1.0, "fallen": 0.0, "recovery": 0.0, "commanded": share})
    assert env.skills == clips
    time = torch.arange(0, 8, 0.05)
    poses = [env.library.pose(torch.full((len(time),), k), time)[0][:, 7:] for k in range(3)]
    for seed in (0, None):  # the second also takes what the first has drawn ahead
        obs, _ = env.reset(seed=seed)
        pose = env.state.qpos[:, 7:].float()
        shown = torch.stack([torch.cdist(pose, known).amin(1) for known in poses]).argmin(0)
        assert (shown.numpy() == obs["skill"]).mean() == pytest.approx(own, abs=0.1)


def test_as_many_weights_as_skills():
    env = make(1)
    with pytest.raises(SuiteError, match="one for each of"):
        env.set_skill_weights(torch.ones(len(env.skills) + 1))
    for weight in (0.0, -1.0, torch.nan):
        with pytest.raises(SuiteError, match="none below 0 and not all 0"):
            env.set_skill_weights(torch.full((len(env.skills),), weight))


def test_without_the_ground_no_episode_begins_on_it():
    env = make(20, **FALLING)
    env.set_ground_contact(False)
    env.reset(seed=0)
    upright = env.state.qpos[:, 2].clone()
    env.set_ground_contact(True)
    env.reset(seed=0)
    assert upright.mean() > 0.6 > env.state.qpos[:, 2].mean()


def test_without_the_ground_any_touch_ends_the_episode():
    """Lying and touching, but with no body low enough for a fall."""
    lengths = {}
    for allowed in (True, False):
        env = make(8, fall={"height": -9.0, "heights": {}}, episode_steps=90)
        env.set_ground_contact(allowed)
        env.reset(seed=0, options={"start": "default"})
        limp = np.zeros((8, 31), np.float32)
        limp[:, 17:20] = -0.5
        ends = [env.step(limp)[2] for _ in range(80)]
        lengths[allowed] = np.any(ends, axis=0).mean()
    assert lengths == {True: 0.0, False: 1.0}


def test_forbidding_the_ground_needs_the_grounds_own_touch():
    env = make(1, fall={"contact": "any"})
    with pytest.raises(SuiteError, match=r"fall\.contact=any"):
        env.set_ground_contact(False)


@pytest.mark.parametrize(("form", "expected"), [("sum", [1.0, np.exp(-1.5)]), ("mean", [1.0, np.exp(-1.5 / 15)])])
def test_reward_for_doing_without_residual_forces_by_hand(form: Literal["sum", "mean"], expected: list[float]):
    action = torch.zeros(2, 45)
    action[1, :3] = torch.tensor([0.3, 0.0, 0.4])
    action[1, 3] = -7.0  # clamped to one
    assert ResidualForces(load_character(), 50.0, form).reward(action).tolist() == pytest.approx(expected)


def test_the_environment_tells_residual_reward_force_and_torque():
    env = make(2, residual_force=50.0)
    env.reset(seed=0, options={"start": "default"})
    action = np.zeros((2, 76), np.float32)
    action[1, 31:34] = [0.6, 0.0, 0.8]
    info = env.step(action)[4]
    assert info["side_rewards"]["residual"].tolist() == pytest.approx([1.0, np.exp(-1.0)])
    assert info["residual_force"].tolist() == pytest.approx([0.0, 50.0])
    assert info["joint_torque"] == pytest.approx(np.linalg.norm(env.state.actuator_force.numpy(), axis=1))
    assert (info["joint_torque"] > 1.0).all()
    assert "side_rewards" not in make(1).step(np.zeros((1, 31), np.float32))[4]
