"""How worlds and clips are seen: links from where the character is now, and the papers' state beside them."""

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from murmillo.envs import EnvConfig, HumanoidVectorEnv, SuiteError
from murmillo.envs.character import Character, load_character
from murmillo.envs.features import CharacterFeatures, LinkFeatures
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.rotations import heading, heading_quat, quat_conj, quat_mul, quat_rotate
from murmillo.envs.starts import StartConfig

CHARACTERS = ("humanoid", "sword_shield")
TURN = torch.tensor([np.cos(0.6), 0.0, 0.0, np.sin(0.6)], dtype=torch.float64)
UPRIGHT = StartConfig(recovery=0.0, fallen=0.0, reference=1.0)


def make(name: str = "humanoid", num_envs: int = 6, **kwargs) -> HumanoidVectorEnv:
    settings = {"character": name, "features": "links", "window": 5, "starts": UPRIGHT, "threads": 1} | kwargs
    return HumanoidVectorEnv(num_envs, EnvConfig(**settings))


def act(env: HumanoidVectorEnv, seed: int) -> dict[str, np.ndarray]:
    noise = np.random.default_rng(seed).uniform(-0.3, 0.3, env.action_space.shape)
    return env.step(noise.astype(np.float32))[0]


def links(env: HumanoidVectorEnv, values: np.ndarray | Tensor, width: int) -> Tensor:
    return torch.as_tensor(values).unflatten(-1, (len(env.character.bodies), width))


@pytest.mark.parametrize("name", CHARACTERS)
def test_velocities_of_links_are_the_engines(name: str) -> None:
    env = make(name)
    env.reset(seed=0)
    act(env, 0)
    state, model = env.state, env.scene.model
    linear, angular = env.character.velocities(state.body_pos_w, state.body_quat_w, state.qvel)
    data, found = mujoco.MjData(model), np.zeros(6)
    for world in range(env.num_envs):
        data.qpos[:], data.qvel[:] = state.qpos[world], state.qvel[world]
        mujoco.mj_forward(model, data)
        for body in range(len(env.character.bodies)):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body + 1, found, 0)
            expected = torch.cat((angular[world, body], linear[world, body])).numpy()
            np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_newest_frame_is_seen_from_its_own_root_and_the_others_from_there_too() -> None:
    env = make()
    env.reset(seed=0)
    seen = []
    for step in range(4):
        pos_w, quat_w = env.state.body_pos_w.clone(), env.state.body_quat_w.clone()
        seen.append((pos_w, quat_w))
        obs = act(env, step)
    assert obs["length"].tolist() == [4] * 6
    state = links(env, obs["state"], 13).double()
    root_w, root_quat_w = env.state.qpos[:, :3], env.state.qpos[:, 3:7]
    assert state[:, -1, 0, :2].abs().max() < 1e-6
    torch.testing.assert_close(state[:, -1, 0, 2], root_w[:, 2], atol=1e-6, rtol=0)
    assert heading(state[:, -1, 0, 3:7]).abs().max() < 1e-5
    yaw = heading(root_quat_w)
    root_velocity = quat_rotate(quat_conj(heading_quat(root_quat_w)), env.state.qvel[:, :3])
    torch.testing.assert_close(state[:, -1, 0, 7:10], root_velocity, atol=1e-5, rtol=1e-5)
    root_spin = quat_rotate(state[:, -1, 0, 3:7], env.state.qvel[:, 3:6])
    torch.testing.assert_close(state[:, -1, 0, 10:13], root_spin, atol=1e-4, rtol=1e-4)
    for back, (pos_w, _) in enumerate(reversed(seen[1:]), start=1):
        offset = pos_w - root_w.unsqueeze(1)
        offset[..., 2] = pos_w[..., 2]
        ahead, aside = yaw.cos().unsqueeze(-1), yaw.sin().unsqueeze(-1)
        x = ahead * offset[..., 0] + aside * offset[..., 1]
        y = ahead * offset[..., 1] - aside * offset[..., 0]
        torch.testing.assert_close(state[:, -1 - back, :, 0], x, atol=1e-5, rtol=0)
        torch.testing.assert_close(state[:, -1 - back, :, 1], y, atol=1e-5, rtol=0)
        torch.testing.assert_close(state[:, -1 - back, :, 2], offset[..., 2], atol=1e-5, rtol=0)


def test_a_state_begins_with_one_frame_and_zeros() -> None:
    env = make()
    obs, _ = env.reset(seed=0)
    for length in (1, 2, 3, 4, 4):
        assert obs["length"].tolist() == [length] * 6
        assert env.observation_space.contains(obs)
        assert (obs["state"][:, length:] == 0.0).all()
        assert (np.abs(obs["state"][:, :length]).max(-1) > 0.1).all()
        obs = act(env, length)


def test_a_window_is_full_from_the_begin_and_ends_with_the_states_poses() -> None:
    env = make()
    obs, _ = env.reset(seed=0)
    for step in range(3):
        newest = links(env, obs["state"], 13)[torch.arange(6), torch.as_tensor(obs["length"]) - 1]
        assert torch.equal(links(env, obs["window"], 7)[:, -1], newest[..., :7])
        assert (np.abs(obs["window"]).max(-1) > 0.1).all()
        obs = act(env, step)


@pytest.mark.parametrize("name", CHARACTERS)
def test_a_clip_looks_as_its_simulation_does(name: str) -> None:
    """Poses of clips, put into the engine one after the other, give the library's windows and states."""
    env = make(name, num_envs=16)
    library, features = env.library, env.library.features
    clip, time = library.sample(16, torch.Generator().manual_seed(0))
    moments = [library.pose(clip, (time - back / 30.0).clamp_min(0.0)) for back in range(4, -1, -1)]
    frames = []
    for qpos, qvel in moments:
        env.physics.write(torch.arange(16), qpos, qvel)
        frames.append(features.simulated(env.state, slice(None)))
    simulated = torch.stack(frames, dim=1)
    torch.testing.assert_close(library.window(clip, time, 5), features.window(simulated), atol=2e-5, rtol=0)
    full = torch.full((16,), 4)
    recorded = features.state(library.frames(clip, time, 4), full)["state"]
    torch.testing.assert_close(recorded, features.state(simulated[:, 1:], full)["state"], atol=1e-4, rtol=1e-4)


def test_what_is_seen_depends_on_neither_place_nor_heading_nor_a_quaternions_sign() -> None:
    env = make()
    env.reset(seed=0)
    features, frames = env.library.features, env._observer.frames.double()
    moved = frames.unflatten(-1, (15, 13)).clone()
    moved[..., :3] = quat_rotate(TURN, moved[..., :3]) + torch.tensor([5.0, -3.0, 0.0])
    moved[..., 3:7] = -quat_mul(TURN, moved[..., 3:7])
    for part in (slice(7, 10), slice(10, 13)):
        moved[..., part] = quat_rotate(TURN, moved[..., part])
    torch.testing.assert_close(features.window(frames), features.window(moved.flatten(-2)), atol=1e-6, rtol=0)
    states = [features.state(f[:, -4:], torch.full((6,), 4))["state"] for f in (frames, moved.flatten(-2))]
    torch.testing.assert_close(*states, atol=1e-6, rtol=0)


def test_who_has_come_far_sees_the_same() -> None:
    env = make()
    env.reset(seed=0)
    kept = env.state_dict()
    near = act(env, 0)
    kept["physics"]["qpos"][:, :2] += 2000.0
    by = torch.tensor([2000.0, 2000.0, 0.0], dtype=torch.float64).repeat(6, 1)
    env.load_state_dict(kept | {"history": env.library.features.moved(kept["history"], by)})
    far = act(env, 0)
    assert env.state.qpos[:, :2].abs().min() > 1900.0
    for name, value in far.items():
        np.testing.assert_allclose(value, near[name], atol=5e-3)


@pytest.mark.parametrize("kind", [CharacterFeatures, LinkFeatures])
def test_heights_are_above_the_ground(kind: type) -> None:
    character = load_character("humanoid")
    library = MotionLibrary(load_clips("builtin", character)[:1], character, features=kind(character))
    clip, time = torch.zeros(3, dtype=torch.int64), torch.full((3,), 0.5)
    features, frames = library.features, library.frames(clip, time, 4)
    ground = torch.tensor([0.0, 0.5, -2.0])
    lifted = features.moved(frames, torch.stack((0 * ground, 0 * ground, ground), dim=-1))
    torch.testing.assert_close(features.window(lifted, ground), features.window(frames), atol=1e-6, rtol=0)


def test_masked_links_are_the_key_body_and_the_turn_of_what_carries_only_it() -> None:
    character = load_character()
    mask = LinkFeatures(character).mask(("sword",)).unflatten(0, (17, 7))
    assert mask[character.bodies.index("sword")].all()
    hand = mask[character.bodies.index("right_hand")]
    assert hand.tolist() == [False] * 3 + [True] * 4
    assert mask.sum() == 11


def test_demonstrations_have_the_windows_form() -> None:
    env = make()
    drawn = env.demonstrations(7, torch.Generator().manual_seed(0))
    assert drawn["window"].shape == (7, 5, 105)
    pairs = env.demonstrations.imitation_pairs(7, torch.Generator().manual_seed(0))
    assert {name: tuple(value.shape) for name, value in pairs.items()} == {
        "state": (7, 4, 195),
        "length": (7,),
        "skill": (7,),
        "action": (7, 28),
    }


def test_a_state_continues_bit_for_bit() -> None:
    env = make()
    env.reset(seed=0)
    for step in range(3):
        act(env, step)
    kept = env.state_dict()
    first = act(env, 9)
    env.load_state_dict(kept)
    again = act(env, 9)
    assert all(np.array_equal(first[name], again[name]) for name in first)


def test_an_unknown_form_is_refused() -> None:
    with pytest.raises(SuiteError, match="features=link: no such choice; there are: character, links"):
        make(features="link")


def test_a_character_without_locks_is_its_own_base() -> None:
    character: Character = load_character("humanoid")
    assert character.base is character
    assert character.pruned == ()
