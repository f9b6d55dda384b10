"""Friction of each world's ground, and pushes that come whatever the task."""

import gymnasium
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.character import load_character
from murmillo.envs.tasks.pushes import PushConfig, RandomPushes


def make(num_envs: int = 4, name: str = "Navigate", **kwargs) -> HumanoidVectorEnv:
    env = gymnasium.make_vec(f"murmillo/{name}-v0", num_envs=num_envs, threads=1, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    env.reset(seed=0, options={"start": "default"})
    return env


def stand(env: HumanoidVectorEnv) -> np.ndarray:
    return env.character.action_for(env.character.default_qpos).float().repeat(env.num_envs, 1).numpy()


def steepest(env: HumanoidVectorEnv, pushed: float) -> torch.Tensor:
    """[N] greatest share of sideways in upward ground force over a third of a second under a push [N]."""
    found = torch.zeros(env.num_envs, dtype=torch.float64)
    for _ in range(10):
        env.push(torch.tensor([pushed, 0.0, 0.0]).repeat(env.num_envs, 1))
        env.step(stand(env))
        force = env.state.ground_force_w.sum(1)
        found = torch.maximum(found, force[:, :2].norm(dim=-1) / force[:, 2].abs().clamp_min(50.0))
    return found


def test_the_ground_holds_as_its_friction_lets_it() -> None:
    icy, dry = make(friction=(0.15, 0.15)), make()
    assert steepest(icy, 250.0).max() < 0.15 + 1e-6
    assert steepest(dry, 250.0).min() > 0.3


def test_each_world_has_a_friction_of_its_own_anew_with_each_episode() -> None:
    env = make(64, friction=(0.2, 0.9))
    drawn = [env.physics.state_dict()["friction"][:, 0, 0].clone()]
    env.reset()
    drawn.append(env.physics.state_dict()["friction"][:, 0, 0].clone())
    for friction in drawn:
        assert 0.2 <= friction.min() < 0.3 < 0.8 < friction.max() <= 0.9
        assert len(friction.unique()) == 64
    assert not (drawn[0] == drawn[1]).any()
    of_bodies = env.physics.state_dict()["friction"][:, 1:, 0]
    assert (of_bodies == 1.0).all()


def test_pushes_come_at_their_times_and_last_for_theirs() -> None:
    character, generator = load_character("humanoid"), torch.Generator().manual_seed(0)
    pushes = RandomPushes(character, PushConfig(every=(10, 12), steps=6), 32)
    pushes.reset(torch.arange(32), generator)
    assert character.bodies[pushes.body] == "torso"
    sizes = []
    for _ in range(200):
        pushes.advance(generator)
        assert (pushes.force_w[:, 2] == 0.0).all()
        sizes.append(pushes.force_w.norm(dim=-1))
    pushed = torch.stack(sizes) > 0.0
    assert torch.stack(sizes)[pushed].tolist() == pytest.approx([1000.0] * int(pushed.sum()))
    for world in range(32):
        begins = (pushed[1:, world] & ~pushed[:-1, world]).nonzero().squeeze(-1)
        ends = (~pushed[1:, world] & pushed[:-1, world]).nonzero().squeeze(-1)
        assert set(begins.diff().tolist()) <= {10, 11, 12}
        lengths = ends[ends > begins[0]][: len(begins)] - begins[: len(ends[ends > begins[0]])]
        assert set(lengths.tolist()) == {6}
    pushes.advance(generator)
    under_way = pushes.force_w.norm(dim=-1) > 0.0
    again = torch.arange(32) % 2 == 0
    assert (under_way & again).any()
    pushes.reset(again.nonzero().squeeze(-1), generator)
    assert torch.equal(pushes.force_w.norm(dim=-1) > 0.0, under_way & ~again)


def test_a_push_moves_the_torso_of_the_world_that_it_comes_in() -> None:
    calm, env = make(), make(pushes={"every": (2, 2)})
    for _ in range(2):
        calm.step(stand(calm))
        env.step(stand(env))
    torso = env.character.bodies.index("torso")
    before = [e.state.body_pos_w[:, torso].clone() for e in (calm, env)]
    assert torch.equal(*before)
    for _ in range(2):
        calm.step(stand(calm))
        env.step(stand(env))
    moved = (env.state.body_pos_w - calm.state.body_pos_w)[:, torso, :2].norm(dim=-1)
    assert moved.min() > 0.02


def test_a_push_of_a_users_adds_to_them() -> None:
    env = make(pushes={"every": (1, 1), "steps": 1})
    env.step(stand(env))
    env.push(torch.tensor([0.0, 0.0, 70.0]).repeat(4, 1), "head")
    forces = env._forces.of_step(torch.zeros(4, 0), env.state, None)
    assert forces is not None
    head, torso = (env.character.bodies.index(body) for body in ("head", "torso"))
    assert forces[:, head].tolist() == [[0.0, 0.0, 70.0]] * 4
    assert forces[:, torso].norm(dim=-1).tolist() == pytest.approx([1000.0] * 4)
    assert forces.norm(dim=-1).gt(0.0).sum() == 8


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"friction": (0.9, 0.2)}, r"friction=\(0.9, 0.2\): needs two numbers of at least 0, the lower one first"),
        ({"friction": (-0.1, 0.2)}, "friction="),
        ({"friction": (0.2,)}, r"friction=\(0.2,\)"),
        ({"friction": 0.3}, "friction=0.3: needs two numbers"),
        ({"pushes": {"every": 5}}, "pushes.every=5: needs at least 1 twice"),
        ({"pushes": {"every": (1.5, 2.0)}}, r"pushes.every=\(1.5, 2.0\)"),
        ({"pushes": {"every": (5, 9), "force": 1000.0}}, "pushes.force=1000.0: needs two numbers of at least 0"),
        ({"pushes": {"every": (0, 3)}}, r"pushes.every=\(0, 3\): needs at least 1"),
        ({"pushes": {"every": (5, 3)}}, "pushes.every"),
        ({"pushes": {"every": (5, 9), "steps": 0}}, "pushes.steps=0: needs at least 1"),
        ({"pushes": {"every": (5, 9), "body": "tail"}}, "pushes.body=tail: no such body; there are: pelvis"),
    ],
)
def test_disturbances_that_cannot_be_are_refused_in_one_line(settings, message) -> None:
    with pytest.raises(SuiteError, match=message) as caught:
        make(1, **settings)
    assert "\n" not in str(caught.value)
