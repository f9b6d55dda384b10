"""MuJoCo Warp on its CPU device against MuJoCo."""

import pytest
import torch
from torch import Tensor

from murmillo.envs.character import Character, load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.falls import count_every_contact
from murmillo.envs.geometry import lowest_point
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.physics import Physics, make_physics
from murmillo.envs.scene import Scene, add_box, slippery

wp = pytest.importorskip("warp", reason="physics=warp needs the extra gpu: pip install 'murmillo[gpu]'")

ROOM = {"contacts": 48, "constraints": 160}


@pytest.fixture(scope="module", autouse=True)
def _quick_compilation():
    """Half the time of compilation for half the speed, which suits few worlds."""
    usual, wp.config.optimization_level = wp.config.optimization_level, 1
    yield
    wp.config.optimization_level = usual


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def on_warp(scene: Scene | Character, n: int, **settings) -> Physics:
    return make_physics(scene, n, backend="warp", device="cpu", **{**ROOM, **settings})


def both(scene: Scene | Character, n: int) -> tuple[Physics, Physics]:
    return make_physics(scene, n), on_warp(scene, n)


def random_targets(character: Character, n: int, seed: int) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return character.targets(torch.rand(n, 31, dtype=torch.float64, generator=generator) - 0.5)


def thrown(character: Character, n: int, generator: torch.Generator, height: float = 1.0) -> tuple[Tensor, Tensor]:
    """States of characters in the air, turned at random."""
    qpos = character.default_qpos.repeat(n, 1)
    qpos[:, 2] = height
    qpos[:, 3:7] = torch.nn.functional.normalize(torch.randn(n, 4, generator=generator, dtype=torch.float64), dim=-1)
    return qpos, torch.zeros(n, 37, dtype=torch.float64)


@pytest.fixture(scope="module")
def states(character) -> tuple[Tensor, Tensor, Tensor]:
    """qpos, qvel and targets of 128 moments of clips and of 128 of falls, as float32 has them.

    Clips are lifted until they are at most 2 mm in the ground: exactly on it, rounding decides whether they touch.
    """
    generator = torch.Generator().manual_seed(0)
    library = MotionLibrary(load_clips("builtin", character), character)
    clip, time = library.sample(128, generator)
    qpos, qvel = library.pose(clip, time)
    qpos[:, 2] += (-0.002 - lowest_point(character, qpos)).clamp_min(0.0)
    ctrl = character.targets(character.action_for(library.pose(clip, time + character.control_dt)[0]))
    falling = make_physics(character, 128)
    falling.write(torch.arange(128), *thrown(character, 128, generator))
    targets, taken = random_targets(character, 128, 1), torch.randint(5, 60, (128,), generator=generator)
    fallen_qpos, fallen_qvel = torch.zeros_like(qpos), torch.zeros_like(qvel)
    for step in range(60):
        falling.step(targets)
        now = taken == step
        fallen_qpos[now], fallen_qvel[now] = falling.state.qpos[now].float(), falling.state.qvel[now].float()
    return torch.cat((qpos, fallen_qpos)), torch.cat((qvel, fallen_qvel)), torch.cat((ctrl.float(), targets.float()))


def distances(one: Physics, other: Physics) -> Tensor:
    """[N] greatest distance of a body's place in one from that in the other [m]."""
    return (one.state.body_pos_w - other.state.body_pos_w).norm(dim=-1).amax(-1)


def test_a_step_from_256_shared_states_is_that_of_mujoco_to_a_tenth_of_a_millimetre(character, states):
    """The bodies of all but a few: where sword and shield press on each other, MuJoCo's collision finds other points.

    In a control step, which is four, a touch may also begin a step earlier in one of them.
    """
    qpos, qvel, ctrl = states
    engines = both(character, 256)
    for substeps, missed, worst in ((1, 3, 3e-4), (4, 6, 5e-3)):
        for physics in engines:
            physics.write(torch.arange(256), qpos, qvel)
            physics._substeps = substeps  # type: ignore[attr-defined]
            physics.step(ctrl)
        distance = distances(*engines)
        assert (distance > 1e-4).sum() <= missed
        assert distance.max() < worst
        assert distance.median() < 1e-6
        for name in ("body_quat_w", "ground_force_w", "actuator_force"):
            one, other = (getattr(physics.state, name).flatten(1) for physics in engines)
            assert ((one - other).abs().amax(-1) > 0.1).sum() <= 10, name


def test_a_second_of_falling_is_on_average_that_of_mujoco(character):
    engines, generator = both(character, 32), torch.Generator().manual_seed(2)
    start, targets = thrown(character, 32, generator), random_targets(character, 32, 3)
    figures = []
    for physics in engines:
        physics.write(torch.arange(32), *start)
        height, speed, force = [], [], []
        for _ in range(30):
            physics.step(targets)
            height.append(physics.state.qpos[:, 2].mean())
            speed.append(physics.state.qvel.square().mean().sqrt())
            force.append(physics.state.ground_force_w[..., 2].sum(1).mean())
        figures.append([torch.stack(each).mean().item() for each in (height, speed, force)])
    assert figures[1] == pytest.approx(figures[0], rel=0.03)


def test_write_moves_only_the_worlds_it_names_and_forgets_their_past(character):
    physics, fresh = on_warp(character, 3), on_warp(character, 1)
    for step in range(3):
        physics.step(random_targets(character, 3, step))
    before = physics.state.qpos[[0, 2]].clone()
    start = thrown(character, 1, torch.Generator().manual_seed(0), height=0.6)
    physics.write(torch.tensor([1]), *start)
    fresh.write(torch.tensor([0]), *start)
    assert torch.equal(physics.state.qpos[[0, 2]], before)
    assert not physics.state.ground_force_w[1].any()
    for step in range(3):
        ctrl = random_targets(character, 3, step)
        physics.step(ctrl)
        fresh.step(ctrl[1:2])
    assert torch.equal(physics.state.qpos[1], fresh.state.qpos[0])


def test_forces_at_joints_act_as_in_mujoco_and_no_longer_than_their_step(character):
    engines = both(character, 2)
    qpos, qvel = thrown(character, 1, torch.Generator().manual_seed(0), height=3.0)
    force = torch.zeros(2, 17, 3, dtype=torch.float64)
    force[1, character.bodies.index("left_lower_arm")] = torch.tensor([40.0, -20.0, 10.0], dtype=torch.float64)
    targets = character.targets(character.action_for(character.default_qpos)).repeat(2, 1)
    for physics in engines:
        physics.write(torch.arange(2), qpos.repeat(2, 1), qvel.repeat(2, 1))
        for step in range(3):
            physics.step(targets, force if step == 1 else None)
    assert distances(*engines).max() < 1e-5
    assert (engines[1].state.qpos[0] - engines[1].state.qpos[1]).abs().max() > 2e-3


def test_friction_is_each_worlds_own(character):
    scene = Scene(character, slippery)
    engines = both(scene, 3)
    shove = torch.zeros(3, 17, 3)
    shove[:, 0, 0] = 400.0
    stand = character.targets(character.action_for(character.default_qpos)).repeat(3, 1)
    for physics in engines:
        physics.set_friction(torch.tensor([0, 2]), torch.tensor([0.05, 0.5]))
        for _ in range(5):
            physics.step(stand, shove)
    assert distances(*engines).max() < 1e-4
    feet = character.body_ids(character.feet)
    assert engines[1].state.body_pos_w[0, feet, 0].min() > engines[1].state.body_pos_w[1, feet, 0].max() + 0.05


def test_a_prop_is_felt_as_in_mujoco_in_whichever_substep_it_hits(character):
    """Before the last substep the cube has bounced off the head again."""
    scene = Scene(character, lambda spec: add_box(spec, "cube", (0.2, 0.2, 0.2), 0.8))
    engines = both(scene, 2)
    stand = character.targets(character.action_for(character.default_qpos)).repeat(2, 1)
    for physics in engines:
        above = physics.state.body_pos_w[0, character.bodies.index("head")].clone()
        above[2] += 0.43
        physics.state.prop_qpos[0, 0, :3] = above
        physics.state.prop_qvel[0, 0, 2] = -15.0
        physics.step(stand)
    mujoco, warp = (physics.state.hit_force_w for physics in engines)
    assert warp.abs().amax(-1).nonzero().tolist() == [[0, 0, character.bodies.index("head")]]
    assert warp.amin() < -100.0
    torch.testing.assert_close(mujoco, warp.double(), rtol=0.01, atol=1.0)
    for physics in engines:
        physics.step(stand)
    assert not engines[1].state.hit_force_w.any()


def test_with_every_contact_counted_bodies_feel_each_other(character, states):
    touchy = load_character(edit=count_every_contact)
    engines = both(touchy, 64)
    for physics in engines:
        physics.write(torch.arange(64), states[0][128:192], states[1][128:192])
        physics._substeps = 1  # type: ignore[attr-defined]
        physics.step(states[2][128:192])
    mujoco, warp = (physics.state.ground_force_w for physics in engines)
    felt = warp.any(-1)
    assert felt.sum() > 200
    assert ((mujoco - warp).abs().amax(-1) < 0.01 * mujoco.abs().amax(-1) + 1.0)[felt].float().mean() > 0.95


def test_state_dict_continues_bit_for_bit(character):
    one, other = (on_warp(Scene(character, slippery), 2) for _ in range(2))
    one.set_friction(torch.tensor([1]), torch.tensor([0.3]))
    for step in range(4):
        one.step(random_targets(character, 2, step))
    other.load_state_dict(one.state_dict())
    assert torch.equal(one.state.body_pos_w, other.state.body_pos_w)
    for step in range(4):
        for physics in (one, other):
            physics.step(random_targets(character, 2, step))
    assert torch.equal(one.state.qpos, other.state.qpos)


@pytest.mark.parametrize("broken", ["ctrl", "qvel", "absurd"])
def test_a_diverged_world_is_reset_alone_reported_and_kept(character, broken):
    physics, sound = on_warp(character, 4), on_warp(character, 4)
    for step in range(3):
        for each in (physics, sound):
            each.step(random_targets(character, 4, step))
    ctrl = random_targets(character, 4, 9)
    sound.step(ctrl)
    if broken == "ctrl":
        ctrl[2, 5] = torch.nan
    else:
        physics.state.qvel[2, 8] = torch.nan if broken == "qvel" else 1e12
    before = physics.state.qpos.clone()
    physics.step(ctrl)
    assert physics.healed().tolist() == [False, False, True, False]
    assert not sound.healed().any()
    others = [0, 1, 3]
    assert torch.equal(physics.state.qpos[others], sound.state.qpos[others])
    kept = physics.diverged  # type: ignore[attr-defined]  a property of Warp's alone
    assert kept["count"].item() == 1
    assert torch.equal(kept["qpos"], before[[2]])
    assert torch.equal(kept["ctrl"].nan_to_num(), ctrl[[2]].float().nan_to_num())
    fresh = on_warp(character, 1)  # nothing of what was broken is left
    assert torch.equal(physics.state.body_pos_w[2], fresh.state.body_pos_w[0])
    for step in range(4):
        ctrl = random_targets(character, 4, step)
        physics.step(ctrl)
        fresh.step(ctrl[2:3])
        assert not physics.healed().any()
        assert torch.equal(physics.state.qpos[2], fresh.state.qpos[0])


@pytest.mark.parametrize("setting", ["contacts", "constraints"])
def test_too_little_room_is_refused_by_name(character, setting):
    physics = on_warp(character, 2, **{setting: 4})
    with pytest.raises(SuiteError, match=f"{setting}=4: is too little room"):
        physics.step(random_targets(character, 2, 0))


def test_room_is_measured_with_a_margin(character):
    physics = make_physics(character, 2, backend="warp", device="cpu")
    falling = thrown(character, 2, torch.Generator().manual_seed(0))
    physics.write(torch.arange(2), *falling)
    for _ in range(30):
        physics.step(random_targets(character, 2, 0))  # raises where it is too little
    assert 24 <= physics.contacts <= 96  # type: ignore[attr-defined]
    assert 80 <= physics.constraints <= 320  # type: ignore[attr-defined]


def test_devices_that_are_not_there_are_named(character):
    with pytest.raises(SuiteError, match="device=cuda:77: no such device; there are: cpu"):
        make_physics(character, 1, backend="warp", device="cuda:77")
    with pytest.raises(SuiteError, match="device=cuda:0: physics=cpu simulates on the CPU"):
        make_physics(character, 1, device="cuda:0")
    if not torch.cuda.is_available():
        with pytest.raises(SuiteError, match="there is no GPU"):
            make_physics(character, 1, backend="warp")
