"""Uneven ground: its heights are the engine's, the map is what lies about the root, and episodes begin on top of it."""

from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.geometry import geom_places
from murmillo.envs.terrain import KINDS, MAP_SHAPE, Terrain, TerrainConfig, make_terrain
from murmillo.envs.tiles import OBSTACLE_HEIGHT, TILES

DOWN = np.array([0.0, 0.0, -1.0])
GROUND_ONLY = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)


def make(num_envs: int = 8, name: str = "Navigate", kind: str = "mixed", **kwargs) -> HumanoidVectorEnv:
    terrain = {"kind": kind, "tiles": 2} | kwargs.pop("terrain", {})
    env = gymnasium.make_vec(f"murmillo/{name}-v0", num_envs=num_envs, threads=1, terrain=terrain, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def noise(env: HumanoidVectorEnv, seed: int) -> np.ndarray:
    shape = (env.num_envs, env.character.action_dim)
    return np.random.default_rng(seed).uniform(-0.3, 0.3, shape).astype(np.float32)


def ground_of(env: HumanoidVectorEnv) -> Terrain:
    assert env.terrain is not None
    return env.terrain


def ground_model(terrain: Terrain) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    terrain.edit(spec)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("kind", [*TILES, "mixed", "flat"])
def test_heights_are_where_the_engines_rays_end(kind: Any) -> None:
    terrain = Terrain(TerrainConfig(kind, obstacles=2, tiles=2))
    model, data = ground_model(terrain)
    place = terrain.half * (
        2.0 * torch.rand(800, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) - 1
    )
    hit = np.zeros(1, np.int32)
    rays = [mujoco.mj_ray(model, data, np.array([x, y, 5.0]), DOWN, GROUND_ONLY, 1, -1, hit) for x, y in place.tolist()]
    np.testing.assert_allclose(5.0 - np.array(rays), terrain.height(place).numpy(), atol=1e-6)
    assert np.ptp(rays) > 0.05


def test_the_map_is_the_ground_about_the_root_turned_with_it() -> None:
    terrain = Terrain(TerrainConfig("rough", obstacles=3, tiles=2))
    root = torch.tensor([[1.3, -2.1, 0.9], [0.0, 0.0, 1.0]], dtype=torch.float64)
    yaw = torch.tensor([0.7, -2.0], dtype=torch.float64)
    quat = torch.stack((torch.cos(yaw / 2), 0 * yaw, 0 * yaw, torch.sin(yaw / 2)), dim=-1)
    seen = terrain.map(root, quat)
    assert seen.shape == (2, *MAP_SHAPE)
    for row, column, ahead, left in ((0, 0, -1.0, -1.7), (10, 17, 0.0, 0.0), (34, 34, 2.4, 1.7), (24, 3, 1.4, -1.4)):
        x = root[:, 0] + ahead * yaw.cos() - left * yaw.sin()
        y = root[:, 1] + ahead * yaw.sin() + left * yaw.cos()
        expected = terrain.height(torch.stack((x, y), dim=-1)) - terrain.height(root)
        torch.testing.assert_close(seen[:, row, column].double(), expected, atol=2e-4, rtol=0)
    assert seen[:, 10, 17].abs().max() < 1e-5


def test_tiles_meet_at_the_same_height_and_worlds_begin_on_them_by_turns() -> None:
    points, random = np.linspace(0.0, 6.0, 61), np.random.default_rng(0)
    for name, tile in TILES.items():
        heights = np.stack([tile(*np.meshgrid(points, points), random) for _ in range(10)])
        edges = (heights[:, 0], heights[:, -1], heights[:, :, 0], heights[:, :, -1])
        assert max(np.abs(edge).max() for edge in edges) == 0.0, name
        assert np.ptp(heights) > 0.15, name
    env = make(8)
    env.reset(seed=0)
    tile = (env.state.qpos[:, :2] / 6.0).floor()
    assert len({tuple(row) for row in tile[:4].tolist()}) == 4
    assert torch.equal(tile[:4], tile[4:])


@pytest.mark.parametrize("name", ["Navigate", "Location"])
def test_gymnasiums_checker_finds_nothing(name: str) -> None:
    check_env(gymnasium.make(f"murmillo/{name}-v0", terrain="mixed").unwrapped, skip_render_check=True)


@pytest.mark.parametrize(
    ("name", "start"), [("Navigate", "reference"), ("Location", "default"), ("Location", "fallen")]
)
def test_nobody_begins_in_the_ground_or_beside_an_obstacle(name: str, start: str) -> None:
    env = make(16, name, terrain={"obstacles": 4})
    terrain, bodies = ground_of(env), env.character
    for seed in range(3):
        env.reset(seed=seed, options={"start": start})
        centre, lowest = geom_places(bodies, env.state.qpos)
        assert (lowest - terrain.height(centre)).min() > -1e-5
        around = terrain.map(env.state.qpos[:, :3], env.state.qpos[:, 3:7])[:, 7:14, 14:21]
        assert around.max() < 0.5 * OBSTACLE_HEIGHT
        above = env.state.qpos[:, 2] - terrain.height(env.state.qpos)
        assert above.max() < 1.6


@pytest.mark.parametrize("kind", ["slopes", "stones"])
def test_what_is_observed_of_a_start_does_not_depend_on_where_it_is(kind: str) -> None:
    """But for a lift out of the ground, links and windows on uneven ground are those of the clips on level ground."""
    flat, uneven = make(8, kind="flat"), make(8, kind=kind)
    for env in (flat, uneven):
        env.reset(seed=3)
        env._starts.forget()
    starts = [env._starts.draw(torch.arange(8), env._fell, torch.Generator().manual_seed(5)) for env in (flat, uneven)]
    terrain, env = ground_of(uneven), uneven
    by = terrain.settle(env.character, starts[1].qpos, torch.arange(8), torch.Generator().manual_seed(0))
    moved = env._starts.moved(starts[1], by)
    ground = terrain.height(moved.qpos)
    lift = by[:, 2] - ground
    assert (lift >= -1e-9).all()
    features = env.library.features
    windows = [features.window(starts[0].frames), features.window(moved.frames, ground + lift)]
    torch.testing.assert_close(*windows, atol=2e-5, rtol=0)


def test_the_observation_is_of_the_ground_where_the_character_is_now() -> None:
    env = make(6, terrain={"obstacles": 2}, episode_steps=15)
    obs, _ = env.reset(seed=0)
    terrain = ground_of(env)
    for step in range(40):
        assert env.observation_space.contains(obs)
        root = env.state.qpos
        expected = terrain.map(root[:, :3], root[:, 3:7]).numpy()
        np.testing.assert_allclose(obs["heights"], expected, atol=5e-4)  # float32 beside walls, whatever the batch
        newest = obs["state"][np.arange(6), obs["length"] - 1]
        np.testing.assert_allclose(newest[:, 2], (root[:, 2] - terrain.height(root)).numpy(), atol=1e-5)
        np.testing.assert_array_equal(obs["window"][:, -1, :7], newest[:, :7])
        obs, *_ = env.step(noise(env, step))


def test_the_papers_state_has_its_height_above_the_ground() -> None:
    env = make(8, "Location", kind="slopes", window=3)
    obs, _ = env.reset(seed=0)
    terrain = ground_of(env)
    for step in range(3):
        height = env.state.qpos[:, 2] - terrain.height(env.state.qpos)
        np.testing.assert_allclose(obs["state"][:, 0], height.numpy(), atol=1e-5)
        np.testing.assert_array_equal(obs["window"][:, -1], obs["state"])
        obs, *_ = env.step(noise(env, step))
    assert terrain.height(env.state.qpos).abs().max() > 0.1


def test_standing_on_a_slope_is_no_fall_however_deep_the_pit() -> None:
    env = make(1, kind="slopes")
    env.reset(seed=0)
    state, bodies = env.state, len(env.character.bodies)
    force = torch.full_like(state.ground_force_w, 50.0)
    for height, ground, fall in ((-0.5, -0.9, False), (-0.5, -0.6, True), (0.5, 0.4, True), (0.5, 0.2, False)):
        pos = torch.full((1, bodies, 3), height, dtype=torch.float64)
        now = type(state)(**{**vars(state), "ground_force_w": force, "body_pos_w": pos})
        assert env._fallen(now, torch.tensor([ground], dtype=torch.float64)).tolist() == [fall]


def test_who_lies_on_a_hill_has_fallen() -> None:
    env = make(16, "Location", kind="slopes", starts={"free_steps": 0})
    env.reset(seed=0, options={"start": "fallen"})
    ground, fell = ground_of(env).height(env.state.qpos), np.zeros(16, dtype=bool)
    assert ground.max() > 0.35
    for step in range(20):
        *_, info = env.step(noise(env, step))
        fell |= info["fall"]
    assert fell.all()


def test_who_leaves_the_field_is_truncated_and_not_terminated() -> None:
    env = make(2, kind="stones", name="Location")
    env.reset(seed=0, options={"start": "default"})
    qpos = env.state.qpos.clone()
    qpos[0, 0] = ground_of(env).half - 0.2
    env.physics.write(torch.arange(2), qpos, torch.zeros_like(env.state.qvel))
    _, _, terminated, truncated, _ = env.step(noise(env, 0))
    assert truncated.tolist() == [True, False]
    assert not terminated.any()


def test_a_standing_character_stands_on_the_terrain() -> None:
    env = make(8, "Location", kind="steps")
    env.reset(seed=0, options={"start": "default"})
    begin = env.state.qpos[:, 2].clone()
    stand = env.character.action_for(env.character.default_qpos).float().repeat(8, 1)
    for _ in range(10):
        env.step(stand)
    assert (env.state.ground_force_w[..., 2].sum(-1) > 100.0).all()
    assert (env.state.qpos[:, 2] - begin).abs().max() < 0.25


def test_a_state_continues_bit_for_bit() -> None:
    env = make(4, friction=(0.2, 1.0), pushes={"every": (3, 6)}, terrain={"obstacles": 1})
    env.reset(seed=0)

    def roll(n: int) -> list[np.ndarray]:
        seen = []
        for step in range(n):
            obs, reward, *_ = env.step(noise(env, step))
            seen += [*obs.values(), reward]
        return seen

    roll(5)
    kept, now = env.state_dict(), env.observation()
    first = roll(12)
    env.load_state_dict(kept)
    assert all(np.array_equal(now[name], value) for name, value in env.observation().items())
    assert all(map(np.array_equal, first, roll(12)))


@pytest.mark.parametrize(
    ("terrain", "message"),
    [
        ({"kind": "lava"}, "terrain.kind=lava: no such ground; there are: flat, slopes, rough"),
        ({"spacing": 0.25}, "terrain.spacing=0.25: is too coarse for a map of 0.1 m; take at most 0.1"),
        ({"spacing": 0.07}, "terrain.spacing=0.07: needs a whole fraction of 6 m"),
        ({"spacing": float("nan")}, "terrain.spacing=nan"),
        ({"tiles": 0}, "terrain.tiles=0: needs a number from 1 to 16"),
        ({"tiles": 1.5}, "terrain.tiles=1.5: needs a number from 1 to 16"),
        ({"seed": -1}, "terrain.seed=-1: needs at least 0"),
        ({"obstacles": -1}, "terrain.obstacles=-1: needs at least 0"),
        ({"obstacles": 400}, "terrain.obstacles=400: leave no room to stand on a tile; take fewer"),
    ],
)
def test_ground_that_cannot_be_is_refused_in_one_line(terrain, message) -> None:
    with pytest.raises(SuiteError, match=message) as caught:
        make_terrain(TerrainConfig(**{"kind": "rough", "tiles": 1, **terrain}))
    assert "\n" not in str(caught.value)


def test_props_need_flat_ground() -> None:
    with pytest.raises(SuiteError, match="terrain: the props of Strike need level ground; leave it flat"):
        make(1, "Strike")


def test_flat_ground_is_the_floor() -> None:
    assert make_terrain(TerrainConfig()) is None
    assert KINDS[0] == "flat"
