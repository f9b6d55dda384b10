"""A library that knows nothing of this project trains on its environments."""

import gymnasium
import numpy as np
import pytest
import torch

import murmillo.envs

sb3 = pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed (extra dev)")


@pytest.mark.slow
def test_stable_baselines3_trains_on_location(tmp_path):
    assert murmillo.envs.HumanoidEnv
    env = gymnasium.make("murmillo/Location-v0", task={"radius": 2.0}, episode_steps=60)
    model = sb3.PPO("MultiInputPolicy", env, n_steps=512, batch_size=128, n_epochs=2, seed=0, device="cpu")
    before = torch.nn.utils.parameters_to_vector(model.policy.parameters()).clone()
    model.learn(2048)
    after = torch.nn.utils.parameters_to_vector(model.policy.parameters())
    assert model.num_timesteps == 2048
    assert torch.isfinite(after).all()
    assert not torch.equal(before, after)
    returns = [episode["r"] for episode in model.ep_info_buffer]
    assert len(returns) > 20
    assert 0.0 <= min(returns) < max(returns) <= 60.0
    model.save(tmp_path / "policy")
    again = sb3.PPO.load(tmp_path / "policy", env=env)
    obs, _ = env.reset(seed=1)
    for _ in range(5):
        action, _ = again.predict(obs, deterministic=True)
        np.testing.assert_array_equal(action, model.predict(obs, deterministic=True)[0])
        obs, *_ = env.step(action)
    env.close()
