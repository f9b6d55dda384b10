"""The environment around MuJoCo Warp, on its CPU device: every task, and what must not depend on the engine."""

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

import murmillo.envs  # noqa: F401 registers the ids
from murmillo.envs.config import EnvConfig
from murmillo.envs.errors import SuiteError
from murmillo.envs.starts import StartConfig
from murmillo.envs.tasks import TASKS
from murmillo.envs.tasks.pushes import PushConfig
from murmillo.envs.terrain import TerrainConfig
from murmillo.envs.vector import HumanoidVectorEnv

wp = pytest.importorskip("warp", reason="physics=warp needs the extra gpu: pip install 'murmillo[gpu]'")

WARP: dict[str, Any] = {"physics": "warp", "device": "cpu", "contacts": 64, "constraints": 320, "tensors": True}
N = 4


def on_warp(**settings: Any) -> EnvConfig:
    return EnvConfig(**{**WARP, **settings})


@pytest.fixture(scope="module", autouse=True)
def _quick_compilation():
    """As in test_warp.py, so that the two share Warp's cache."""
    usual, wp.config.optimization_level = wp.config.optimization_level, 1
    yield
    wp.config.optimization_level = usual


def rolled(env: HumanoidVectorEnv, steps: int, seed: int = 1) -> list[dict[str, torch.Tensor]]:
    """Observations of some steps with random actions."""
    generator = torch.Generator().manual_seed(seed)
    width = env.single_action_space.shape[0]  # type: ignore[index]
    return [env.step(0.5 * torch.rand(env.num_envs, width, generator=generator))[0] for _ in range(steps)]


def made(name: str, **settings: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec(f"murmillo/{name}-v0", N, **settings).unwrapped
    assert isinstance(env, HumanoidVectorEnv)
    return env


@pytest.mark.parametrize("name", TASKS)
def test_every_task_runs_in_float32_and_shows_tensors(name):
    settings = dict(TASKS[name].settings) | {"window": 3, "episode_steps": 3}
    env = made(name, **settings, **WARP)
    obs, _ = env.reset(seed=3)
    cpu = made(name, **settings, tensors=True)
    expected, _ = cpu.reset(seed=3)
    for key, value in expected.items():
        torch.testing.assert_close(obs[key], value, atol=1e-4, rtol=1e-4, msg=f"{key} of the first observation")
    for _ in range(4):  # past the end of an episode
        obs, reward, terminated, truncated, info = env.step(torch.zeros(env.action_space.shape or ()))
        flat: list[Any] = [*obs.values(), reward, terminated, truncated, info["healed"], *info["reward_terms"].values()]
        assert all(isinstance(value, torch.Tensor) for value in flat)
        assert all(torch.isfinite(value).all() for value in flat)
        assert not info["healed"].any()
    low, high = env.task.reward_range
    assert low - 1e-6 <= reward.min() <= reward.max() <= high + 1e-6
    env.close()
    cpu.close()


@pytest.fixture(scope="module")
def burdened() -> EnvConfig:
    """All that acts on the character at once."""
    pushes = PushConfig(every=(2, 3))
    return on_warp(friction=(0.4, 0.9), residual_force=50.0, pushes=pushes, window=2, episode_steps=6)


def test_a_saved_environment_goes_on_bit_for_bit(burdened):
    one, other = (HumanoidVectorEnv(N, burdened) for _ in range(2))
    one.reset(seed=1)
    rolled(one, 4)
    other.load_state_dict(one.state_dict())
    for a, b in zip(rolled(one, 5, seed=2), rolled(other, 5, seed=2), strict=True):
        assert all(torch.equal(a[name], b[name]) for name in a)


def test_a_seed_says_all_that_is_random(burdened):
    one, other = HumanoidVectorEnv(N, burdened), HumanoidVectorEnv(N, burdened)
    one.reset(seed=5)
    other.reset(seed=5)
    for a, b in zip(rolled(one, 8), rolled(other, 8), strict=True):
        assert all(torch.equal(a[name], b[name]) for name in a)


def test_uneven_ground_is_stood_on():
    starts = StartConfig(recovery=0.0, fallen=0.0, reference=0.0)
    config = on_warp(terrain=TerrainConfig(kind="rough", tiles=1), starts=starts)
    env = HumanoidVectorEnv(2, config)
    obs, _ = env.reset(seed=0)
    assert obs["heights"].shape == (2, 35, 35)
    stand = env.character.action_for(env.character.default_qpos).float().repeat(2, 1)
    for _ in range(8):
        obs, *_ = env.step(stand)
    assert (env.state.ground_force_w[:, :, 2].sum(1) > 100.0).all()
    assert (env.state.body_pos_w[..., 2] - env.terrain.height(env.state.body_pos_w) > -0.05).all()  # type: ignore[union-attr]
    env.close()


def test_a_diverged_world_ends_and_the_others_go_on():
    env = HumanoidVectorEnv(N, on_warp())
    env.reset(seed=0)
    actions = torch.zeros(N, 31)
    actions[1, 3] = torch.nan
    _, reward, terminated, _, info = env.step(actions)
    assert info["healed"].tolist() == [False, True, False, False]
    assert terminated[1]
    assert reward.isfinite().all()
    for obs in rolled(env, 2):
        assert obs["state"].isfinite().all()


def test_arrays_are_what_comes_out_unless_tensors_are_asked_for():
    env = HumanoidVectorEnv(2, on_warp(tensors=False))
    obs, info = env.reset(seed=0)
    assert isinstance(obs["state"], np.ndarray)
    obs, reward, terminated, truncated, info = env.step(np.zeros((2, 31), dtype=np.float32))
    assert reward.dtype == np.float64
    for value in (obs["state"], reward, terminated, truncated, info["healed"], info["final_obs"]["state"]):
        assert isinstance(value, np.ndarray)


def test_tensors_hold_what_the_arrays_do():
    arrays, tensors = (HumanoidVectorEnv(3, EnvConfig(tensors=asked)) for asked in (False, True))
    for env in (arrays, tensors):
        env.reset(seed=0)
    for _ in range(3):
        action = np.full((3, 31), 0.1, dtype=np.float32)
        one, other = arrays.step(action), tensors.step(torch.from_numpy(action))
        assert np.array_equal(one[0]["state"], other[0]["state"].numpy())
        assert np.array_equal(one[1], other[1].numpy())


def test_a_device_that_is_not_there_is_named():
    with pytest.raises(SuiteError, match="device=cuda:77: no such device"):
        HumanoidVectorEnv(1, EnvConfig(device="cuda:77"))
    with pytest.raises(SuiteError, match="physics=gpu: no such choice; there are: cpu, warp"):
        HumanoidVectorEnv(1, EnvConfig(physics="gpu"))  # type: ignore[arg-type]
