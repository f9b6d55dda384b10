"""The imitation environment as gymnasium's users meet it."""

import subprocess
import sys
import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import murmillo.envs
from murmillo.envs import EnvConfig, HumanoidEnv, HumanoidVectorEnv, SuiteError
from murmillo.envs._opengl import HEADLESS
from murmillo.envs.observations import character_state
from murmillo.envs.tasks import TASKS

ID = "murmillo/Imitation-v0"
IDS = sorted(spec for spec in gymnasium.registry if spec.startswith("murmillo/"))
UPRIGHT = {"starts": {"fallen": 0.0, "recovery": 0.0}}


def make(num_envs: int = 4, **kwargs: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec(ID, num_envs=num_envs, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def noise(env: HumanoidVectorEnv, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.3, 0.3, (env.num_envs, 31)).astype(np.float32)


def limp(env: HumanoidVectorEnv) -> np.ndarray:
    """Actions under which the character topples within two seconds."""
    action = np.zeros((env.num_envs, 31), np.float32)
    action[:, 17:20] = -0.5  # the right hip
    return action


@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_checker_finds_nothing(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(name)
        check_env(env.unwrapped, skip_render_check=True)
        env.close()


def test_make_in_one_go_needs_no_import():
    code = (
        "import gymnasium; env = gymnasium.make('murmillo.envs:murmillo/Imitation-v0');"
        "obs, _ = env.reset(seed=0); print(obs['state'].shape, env.action_space.shape)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "(120,) (31,)"


def test_spaces_and_contents_of_a_step():
    env = make(3, window=5)
    obs, info = env.reset(seed=0)
    assert env.observation_space.contains(obs)
    assert obs["window"].shape == (3, 5, 120)
    obs, reward, terminated, truncated, info = env.step(noise(env, 0))
    assert env.observation_space.contains(obs)
    assert np.array_equal(obs["window"][:, -1], obs["state"])
    assert reward.tolist() == [0.0] * 3
    assert info["reward_terms"]["task"].tolist() == [0.0] * 3
    assert terminated.dtype == truncated.dtype == bool
    assert 0 <= obs["skill"].min() <= obs["skill"].max() < len(env.skills)


def test_what_was_returned_is_not_overwritten_by_later_steps():
    env = make(4, window=3)
    kept, _ = env.reset(seed=0)
    copy = {name: array.copy() for name, array in kept.items()}
    for _ in range(30):
        env.step(limp(env))
    env.set_skill(0)
    for name in copy:
        assert np.array_equal(kept[name], copy[name]), name


ROLLOUT = """
import hashlib, sys, gymnasium, numpy as np, murmillo.envs
env = gymnasium.make_vec("murmillo/Imitation-v0", num_envs=8, window=3, threads=int(sys.argv[1]), residual_force=20.0)
digest, rng = hashlib.sha256(), np.random.default_rng(1)
obs, _ = env.reset(seed=11)
ends = 0
for _ in range(1000):
    obs, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, env.action_space.shape).astype(np.float32))
    ends += int((terminated | truncated).sum())
    for array in (*obs.values(), reward, terminated, truncated, *info["final_obs"].values()):
        digest.update(np.ascontiguousarray(array).tobytes())
print(ends, digest.hexdigest())
"""


def test_two_processes_agree_bit_for_bit_over_1000_steps_at_one_and_two_threads():
    runs = [
        subprocess.run([sys.executable, "-c", ROLLOUT, threads], capture_output=True, text=True, check=True).stdout
        for threads in ("1", "2", "2")
    ]
    assert runs[0] == runs[1] == runs[2]
    assert int(runs[0].split()[0]) > 100  # many resets were part of it


def test_same_step_gives_the_true_last_observation_and_the_next_first():
    env = make(8, episode_steps=20, window=4, **UPRIGHT)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.reset(seed=0)
    ends = 0
    for _ in range(25):
        before = env.observation()["window"]
        obs, _, terminated, truncated, info = env.step(limp(env))
        ended = terminated | truncated
        ends += ended.sum()
        assert np.array_equal(info["_final_obs"], ended)
        # the true successor continues the window, ended or not
        assert np.array_equal(info["final_obs"]["window"][:, :-1], before[:, 1:])
        assert np.array_equal(info["final_obs"]["state"][~ended], obs["state"][~ended])
        if ended.any():
            assert not np.array_equal(info["final_obs"]["state"][ended], obs["state"][ended])
    assert ends >= 8


def test_next_step_returns_the_last_observation_then_resets_and_ignores_that_action():
    env = make(2, episode_steps=3, autoreset="next_step", starts={"fallen": 0.0, "recovery": 0.0, "reference": 0.0})
    env.reset(seed=0)
    flags = []
    for _ in range(8):
        obs, _, terminated, truncated, info = env.step(noise(env, 1))
        flags.append(bool(truncated[0]))
        assert "final_obs" not in info
        if flags[-2:-1] == [True]:  # the step after an end is the reset
            assert obs["state"][0, 0] == pytest.approx(0.89, abs=1e-6)
            assert not terminated[0]
    assert flags == [False, False, True, False, False, False, True, False]


def test_without_autoreset_a_mask_says_which_worlds_begin_again():
    env = make(3, episode_steps=2, autoreset="disabled", **UPRIGHT)
    env.reset(seed=0)
    env.step(noise(env, 0))
    obs, _, _, truncated, _ = env.step(noise(env, 1))
    assert truncated.all()
    again, _ = env.reset(options={"reset_mask": np.array([False, True, False])})
    assert np.array_equal(again["state"][[0, 2]], obs["state"][[0, 2]])
    assert not np.array_equal(again["state"][1], obs["state"][1])


def test_a_fall_terminates_and_the_clock_truncates():
    env = make(16, episode_steps=120, **UPRIGHT)
    env.reset(seed=0, options={"start": "default"})
    fell, clock = np.zeros(16, bool), np.zeros(16, bool)
    for _ in range(120):
        _, _, terminated, truncated, info = env.step(limp(env))
        assert not (terminated & truncated).any()
        assert np.array_equal(info["fall"], terminated)
        fell |= terminated
        clock |= truncated
    assert fell.all()
    assert not clock.any()  # all fell before the clock, and began anew


def test_fallen_starts_lie_down_and_may_do_so_for_two_seconds():
    env = make(16, starts={"fallen": 1.0, "recovery": 0.0})
    obs, _ = env.reset(seed=0)
    assert obs["state"][:, 0].max() < 0.6  # height of the pelvis
    assert not env.state.qvel.any()
    for step in range(1, 62):
        _, _, terminated, _, _ = env.step(np.zeros((env.num_envs, 31), np.float32))
        if step < 60:
            assert not terminated.any(), step
        if terminated.any():
            break
    assert step == 60
    assert terminated.mean() > 0.5


def test_recovery_goes_on_from_the_fall():
    env = make(16, starts={"fallen": 0.0, "recovery": 1.0})
    env.reset(seed=0, options={"start": "default"})
    for _ in range(150):
        obs, _, terminated, _, info = env.step(limp(env))
        if terminated.any():
            assert np.array_equal(obs["state"][terminated], info["final_obs"]["state"][terminated])
            return
    pytest.fail("nobody fell")


def test_shares_of_starts():
    env = make(512, starts={"fallen": 0.3, "reference": 0.5})
    obs, _ = env.reset(seed=3)
    height = obs["state"][:, 0]
    default = np.isclose(height, 0.89, atol=1e-6)
    fallen = height < 0.6
    assert fallen.mean() == pytest.approx(0.3, abs=0.07)
    assert default.mean() == pytest.approx(0.35, abs=0.07)


def test_a_reference_start_brings_the_clips_own_past():
    env = make(32, window=6)
    obs, _ = env.reset(seed=0, options={"start": "reference"})
    library, state = env.library, env.state
    window = torch.from_numpy(obs["window"])
    assert (window[:, 1:] - window[:, :-1]).abs().amax(-1).gt(0).any(-1).float().mean() > 0.9
    simulated = character_state(env.character, state.qpos, state.qvel, state.key_pos_w)
    torch.testing.assert_close(window[:, -1], simulated)
    # the past is the clip's that the start was drawn from
    sample, moments = library.sample, []
    library.sample = lambda *args: moments.append(sample(*args)) or moments[-1]  # type: ignore[method-assign]
    window = torch.from_numpy(env.reset(seed=0, options={"start": "reference"})[0]["window"])
    [(clip, time)] = moments
    assert torch.equal(window[:, :-1], library.window(clip, time, 6)[:, :-1])


def test_starts_drawn_ahead_are_kept_with_the_state_and_forgotten_with_the_seed():
    env, other = make(8, window=3, **UPRIGHT), make(8, window=3, **UPRIGHT)
    env.reset(seed=0)
    some = {"reset_mask": np.arange(8) < 3, "start": "reference"}
    env.reset(options=some)  # of eight that are drawn ahead, five are left
    other.load_state_dict(env.state_dict())
    for worlds in (env, other):
        worlds.reset(options=some)
        worlds.reset(options=some)
    assert torch.equal(env.state.qpos, other.state.qpos)
    first = env.reset(seed=5)[0]["window"]
    assert np.array_equal(first, env.reset(seed=5)[0]["window"])


def test_features_of_a_clips_pose_are_the_simulations_to_1e_5():
    env = make(64, window=2)
    generator = torch.Generator().manual_seed(0)
    clip, time = env.library.sample(64, generator)
    qpos, qvel = env.library.pose(clip, time)
    env.physics.write(torch.arange(64), qpos, qvel)
    state = env.state
    simulated = character_state(env.character, state.qpos, state.qvel, state.key_pos_w)
    torch.testing.assert_close(env.library.window(clip, time, 1)[:, 0], simulated, atol=1e-5, rtol=0)


def test_set_skill_commands_by_name_and_index_until_the_episode_ends():
    env = make(4, episode_steps=5, **UPRIGHT)
    env.reset(seed=0)
    name = env.skills[-1]
    env.set_skill(name, env_ids=[1, 2])
    assert (env.observation()["skill"][[1, 2]] == len(env.skills) - 1).all()
    obs, *_ = env.step(noise(env, 0))
    assert (obs["skill"][[1, 2]] == len(env.skills) - 1).all()
    with pytest.raises(SuiteError, match=f"skill=walkk: no such skill; there are: {env.skills[0]}"):
        env.set_skill("walkk")
    with pytest.raises(SuiteError, match="skill=99"):
        env.set_skill(99)


def test_labels_are_drawn_independently_of_the_starts():
    env = make(512)
    env.reset(seed=0)
    counts = np.bincount(env.observation()["skill"], minlength=len(env.skills))
    assert counts.min() > 0.4 * 512 / len(env.skills)


def test_state_dict_continues_bit_for_bit():
    one, other = make(6, window=3), make(6, window=3)
    one.reset(seed=5)
    other.reset(seed=6)
    for step in range(40):
        one.step(noise(one, step))
    kept = one.state_dict()
    steps = kept["steps"].clone()
    one.step(noise(one, 40))
    assert torch.equal(kept["steps"], steps)  # what was kept does not move with the environment
    one.load_state_dict(kept)
    other.load_state_dict(kept)
    for step in range(60):
        (a, _, end_a, _, _), (b, _, end_b, _, _) = (env.step(2 * noise(one, 100 + step)) for env in (one, other))
        assert all(np.array_equal(a[name], b[name]) for name in a)
        assert np.array_equal(end_a, end_b)


def test_residual_forces_widen_the_action_and_move_the_character():
    still, helped = make(1, **UPRIGHT), make(1, residual_force=50.0, **UPRIGHT)
    assert helped.single_action_space.shape == (76,)
    for env in (still, helped):
        env.reset(seed=0, options={"start": "default"})
    action = np.zeros((1, 76), np.float32)
    for _ in range(10):
        still.step(action[:, :31])
        helped.step(action)
    assert torch.equal(still.state.qpos, helped.state.qpos)
    action[:, 31::3] = 1.0  # ahead
    helped.step(action)
    still.step(action[:, :31])
    assert helped.state.qvel[0, 0] > still.state.qvel[0, 0] + 0.1


def test_one_world_leaves_its_callers_settings_alone():
    config = EnvConfig(threads=1)
    HumanoidEnv(config)
    assert config == EnvConfig(threads=1)


def test_one_world_equals_a_batch_of_one():
    single, batch = gymnasium.make(ID, window=2).unwrapped, make(1, window=2, autoreset="disabled")
    a, _ = single.reset(seed=4)
    b, _ = batch.reset(seed=4)
    for step in range(20):
        action = noise(batch, step)
        a, *_ = single.step(action[0])
        b, *_ = batch.step(action)
    assert np.array_equal(a["window"], b["window"][0])
    assert np.ndim(a["skill"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"num_envs": 0}, "num_envs=0"),
        ({"windw": 3}, "windw: no such argument; did you mean window"),
        ({"starts": {"falen": 0.1}}, "starts.falen: no such argument; did you mean starts.fallen"),
        ({"starts": {"fallen": 1.5}}, "starts.fallen=1.5"),
        ({"fall": {"heights": {"hed": 0.2}}}, "fall.heights.hed: no such body"),
        ({"window": 0}, "window=0"),
        ({"episode_steps": 0}, "episode_steps=0"),
        ({"residual_force": -1.0}, "residual_force=-1.0"),
        ({"autoreset": "never"}, "autoreset=never"),
        ({"residual_reward": "men"}, "residual_reward=men: no such choice; there are: sum, mean"),
        ({"fall": {"contact": "floor"}}, "fall.contact=floor: no such choice; there are: ground, any"),
        ({"render_mode": "ascii"}, "render_mode=ascii: no such choice; there are: rgb_array, human"),
        ({"starts": {"fallen_states": 0}}, "starts.fallen_states=0: needs at least 1"),
        ({"motions": "nowhere/at/all"}, "nowhere/at/all"),
        ({"character": "robot"}, "character=robot"),
    ],
)
def test_wrong_arguments_are_named_with_a_cure(arguments, message):
    with pytest.raises(SuiteError, match=message) as caught:
        make(**{"num_envs": 1, **arguments})
    assert "\n" not in str(caught.value)


def test_a_wrong_action_shape_is_named():
    env = make(2)
    env.reset(seed=0)
    with pytest.raises(SuiteError, match=r"action of shape \(2, 30\): needs \(2, 31\)"):
        env.step(np.zeros((2, 30), np.float32))


def test_any_contact_counts_self_contact_as_a_touch():
    ground, every = make(64, **UPRIGHT), make(64, fall={"contact": "any"}, **UPRIGHT)
    touched = []
    for env in (ground, every):
        env.reset(seed=0, options={"start": "default"})
        for step in range(4):
            env.step(3 * noise(env, step))
        feet = env.character.body_ids(env.character.feet)
        others = [i for i in range(17) if i not in feet]
        touched.append(env.state.ground_force_w[:, others].abs().sum().item())
    assert touched[0] == 0.0
    assert touched[1] > 0.0


def test_frames_of_every_world_show_the_character():
    env = make(2, render_mode="rgb_array", width=160, height=120)
    env.reset(seed=0)
    try:
        frames = env.render()
    except SuiteError as error:
        pytest.skip(str(error))
    assert frames is not None
    assert [frame.shape for frame in frames] == [(120, 160, 3)] * 2
    assert frames[0].std() > 10
    env.close()


@pytest.mark.skipif(not HEADLESS, reason="there is a screen")
def test_a_window_without_a_screen_is_refused_in_one_line():
    env = make(1, render_mode="human")
    env.reset(seed=0)
    with pytest.raises(SuiteError, match="render_mode=human: there is no screen"):
        env.render()


def test_the_package_registers_every_id():
    assert sorted(f"murmillo/{name}-v0" for name in TASKS) == IDS
    assert murmillo.envs.__all__
