"""Other bodies: what becomes longer and heavier, what locks take away, and what stays as the base policy knows it."""

import gymnasium
import mujoco
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.bodies import LOCKS, SHAPES, BodyConfig, load_body
from murmillo.envs.character import Character, load_character
from murmillo.envs.geometry import lowest_point

CHARACTERS = ("humanoid", "sword_shield")


def make(num_envs: int = 4, **kwargs) -> HumanoidVectorEnv:
    env = gymnasium.make_vec("murmillo/Navigate-v0", num_envs=num_envs, threads=1, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def masses(character: Character) -> dict[str, float]:
    return dict(zip(character.bodies, character.model.body_mass[1:].tolist(), strict=True))


def place(character: Character, body: str) -> list[float]:
    """Of a body in its parent [m]."""
    return character.model.body(body).pos.tolist()


@pytest.mark.parametrize("name", CHARACTERS)
@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_stands_on_its_feet_and_keeps_bodies_and_actions(name: str, shape: str) -> None:
    base, body = load_character(name), load_body(name, BodyConfig(shape))
    assert body.bodies == base.bodies
    assert body.action_dim == base.action_dim
    assert body.pruned == ()
    assert body.base.bodies == base.bodies
    assert lowest_point(body, body.default_qpos).item() == pytest.approx(0.0, abs=1e-9)
    assert not np.allclose(body.model.body_pos, base.model.body_pos)


def test_shapes_have_the_papers_factors() -> None:
    base = load_character("humanoid")
    thighs, big, long = (load_body("humanoid", BodyConfig(name)) for name in ("LongThighs", "BigBody", "LongBody"))
    assert place(thighs, "left_shin")[2] == pytest.approx(1.5 * place(base, "left_shin")[2])
    assert place(thighs, "left_foot") == place(base, "left_foot")
    assert place(long, "torso")[2] == pytest.approx(1.5 * place(base, "torso")[2])
    assert masses(big)["torso"] == pytest.approx(1.5**3 * masses(base)["torso"])  # "over 300 %"
    assert place(big, "left_upper_arm") == pytest.approx([1.5 * x for x in place(base, "left_upper_arm")])
    tallest = load_body("humanoid", BodyConfig("SuperLongLegs"))
    head = tallest.forward_kinematics(tallest.default_qpos)[0][tallest.bodies.index("head"), 2]
    assert head.item() + 0.27 > 2.0  # the crown of the head; "over 2 m tall"
    arms = load_body("humanoid", BodyConfig("AsymmetricUpperArms"))
    assert place(arms, "right_lower_arm")[2] / place(arms, "left_lower_arm")[2] == pytest.approx(1.25 / 0.75)


def test_a_longer_limb_weighs_more_by_its_volume() -> None:
    """A capsule of radius r and length l holds pi r² (l + 4 r / 3)."""
    base, body = load_character("humanoid"), load_body("humanoid", BodyConfig(length={"left_thigh": 1.5}))
    volume = [0.055**2 * (length + 4.0 * 0.055 / 3.0) for length in (0.30, 0.45)]
    assert masses(body)["left_thigh"] / masses(base)["left_thigh"] == pytest.approx(volume[1] / volume[0])
    assert masses(body)["right_thigh"] == masses(base)["right_thigh"]


def test_factors_add_to_a_shape_and_density_to_a_mass() -> None:
    body = load_body("humanoid", BodyConfig("LongShins", length={"left_shin": 0.8}, density={"head": 2.0}))
    base = load_character("humanoid")
    assert place(body, "left_foot")[2] == pytest.approx(1.2 * place(base, "left_foot")[2])
    assert masses(body)["head"] == pytest.approx(2.0 * masses(base)["head"])


def test_what_is_turned_in_its_body_is_stretched_along_the_body() -> None:
    """A strap of the sandal, turned by 0.25 rad about y, on a foot that is twice as long."""
    base, body = load_character("humanoid"), load_body("humanoid", BodyConfig(length={"right_foot": 2.0}))
    models = [character.render_model() for character in (base, body)]
    foot, box = models[0].body("right_foot").id, mujoco.mjtGeom.mjGEOM_BOX
    straps = [g for g in range(models[0].ngeom) if models[0].geom_bodyid[g] == foot and models[0].geom_type[g] == box]
    turned = [g for g in straps if models[0].geom_quat[g, 2] == pytest.approx(np.sin(0.125))]
    assert len(turned) == 1
    along = [np.hypot(2.0 * np.cos(0.25), np.sin(0.25)), 1.0, np.hypot(2.0 * np.sin(0.25), np.cos(0.25))]
    assert models[1].geom_size[turned[0]] == pytest.approx(models[0].geom_size[turned[0]] * along)


@pytest.mark.parametrize("name", CHARACTERS)
@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_takes_its_joints_and_says_which_outputs_go(name: str, lock: str) -> None:
    base, body = load_character(name), load_body(name, BodyConfig(locked=(lock,)))
    gone = [joint for joint in base.joints if joint.name in LOCKS[lock]]
    outputs = [action for joint in gone for action in range(joint.action.start, joint.action.stop)]
    assert body.pruned == tuple(outputs)
    assert body.action_dim == base.action_dim - len(outputs) == body.model.nu
    kept = [action for action in range(base.action_dim) if action not in outputs]
    assert torch.equal(body.action_offset, base.action_offset[kept])
    assert torch.equal(body.action_scale, base.action_scale[kept])
    assert body.bodies == base.bodies


def test_poses_go_to_the_base_and_back() -> None:
    body = load_body("humanoid", BodyConfig(locked=("abdomen", "right_knee")))
    qpos, qvel = (torch.randn(5, width, dtype=torch.float64) for width in (body.model.nq, body.model.nv))
    full_qpos, full_qvel = body.to_base(qpos, qvel)
    assert full_qpos.shape[-1] == body.base.model.nq
    joints = {joint.name: joint for joint in body.base.joints}
    assert full_qpos[0, joints["abdomen"].qpos].tolist() == [1.0, 0.0, 0.0, 0.0]
    assert full_qpos[0, joints["right_knee"].qpos].tolist() == [0.0]
    assert full_qvel[:, joints["abdomen"].dof].abs().max() == 0.0
    again = body.from_base(full_qpos, full_qvel)
    assert torch.equal(again[0], qpos)
    assert torch.equal(again[1], qvel)


@pytest.mark.parametrize("features", ["links", "character"])
def test_a_locked_body_is_seen_as_its_base_is(features: str) -> None:
    """So that the base's policy can be asked; demonstrations stay those of the base."""
    base, env = make(features=features), make(features=features, body={"locked": ("right_knee", "abdomen")})
    assert env.single_observation_space == base.single_observation_space
    assert env.action_space.shape == (4, 24)
    assert env.character.pruned == (0, 1, 2, 17)
    assert make(1, body={"locked": "right_knee"}).character.pruned == (17,)
    drawn = [e.demonstrations(5, torch.Generator().manual_seed(0))["window"] for e in (base, env)]
    assert torch.equal(*drawn)
    obs, _ = env.reset(seed=0)
    assert env.observation_space.contains(obs)
    env.step(np.zeros((4, 24), np.float32))
    pairs = [e.demonstrations.imitation_pairs(3, torch.Generator().manual_seed(1)) for e in (base, env)]
    kept = [action for action in range(28) if action not in env.character.pruned]
    assert torch.equal(pairs[0]["action"][:, kept], pairs[1]["action"])
    assert torch.equal(pairs[0]["state"], pairs[1]["state"])


def test_starts_of_longer_legs_are_above_the_floor() -> None:
    env = make(32, body="SuperLongLegs")
    env.reset(seed=0)
    assert lowest_point(env.character, env.state.qpos).min() > -1e-5
    env.reset(seed=0, options={"start": "default"})
    lowest = lowest_point(env.character, env.state.qpos)
    assert lowest.tolist() == pytest.approx([0.89 - 0.8814] * 32, abs=1e-4)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("LongThigs", "body.shape=LongThigs: no such shape; did you mean LongThighs?"),
        ({"length": {"thigh": 1.5}}, "body.length.thigh: no such body; there are: pelvis, torso"),
        ({"length": {"pelvis": 0.0}}, "body.length.pelvis=0.0: needs a factor above 0"),
        ({"density": {"head": float("nan")}}, "body.density.head=nan: needs a factor above 0"),
        ({"length": {"pelvis": "long"}}, "body.length.pelvis=long: needs a factor above 0"),
        ({"length": 1.5}, "body.length=1.5: needs values by name, a dict"),
        (1.5, "body=1.5: needs values by name, a dict"),
        ({"locked": ("knee",)}, "body.locked=knee: no such joint; there are: abdomen, elbows, ankles, right_knee"),
        ({"thickness": {"left_thigh": 3.0}}, r"body: \w+ and left_thigh interpenetrate by .* cm at rest; take smaller"),
        ({"lenght": {}}, "body.lenght: no such argument; did you mean body.length?"),
    ],
)
def test_bodies_that_cannot_be_are_refused_in_one_line(body, message) -> None:
    with pytest.raises(SuiteError, match=message) as caught:
        make(1, body=body)
    assert "\n" not in str(caught.value)
