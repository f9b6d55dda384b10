"""Following a clip of the commanded skill: where it should be, what it earns, and when it is lost."""

import dataclasses
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch

from murmillo.envs import HumanoidVectorEnv, SuiteError
from murmillo.envs.character import CONTROL_DT, Character, load_character
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.observations import character_state, state_parts
from murmillo.envs.skills import CommandedSkills
from murmillo.envs.tracking import PROGRESS_SIZE, Tracker, TrackingConfig

CLIPS = ("guard", "kick", "taunt")
GUARD, KICK, TAUNT = range(3)  # of clips and of skills alike
UPRIGHT = {"reference": 1.0, "fallen": 0.0, "recovery": 0.0, "commanded": 1.0}


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


@pytest.fixture(scope="module")
def library(character: Character) -> MotionLibrary:
    return MotionLibrary(load_clips("builtin", character, CLIPS), character)


@pytest.fixture
def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def make(num_envs: int, **kwargs: Any) -> HumanoidVectorEnv:
    env = gymnasium.make_vec("murmillo/Imitation-v0", num_envs=num_envs, threads=1, clips=CLIPS, **kwargs)
    assert isinstance(env, HumanoidVectorEnv)
    return env


def tracker(
    character: Character, library: MotionLibrary, skill: list[int], **changes: Any
) -> tuple[Tracker, CommandedSkills]:
    """One world for each of the commanded skills."""
    skills = CommandedSkills(library.skills, len(skill))
    skills.put(torch.arange(len(skill)), torch.tensor(skill))
    return Tracker(character, library, skills, TrackingConfig(follow=True, **changes), len(skill)), skills


def at(library: MotionLibrary, clip: int, time: float) -> torch.Tensor:
    """The clip's state [1, 120] at this time."""
    return library.frames(torch.tensor([clip]), torch.tensor([time], dtype=torch.float64), 1)[:, 0]


def test_the_parts_of_the_state_are_where_they_are_said_to_be(character: Character):
    parts = state_parts(character)
    qpos, qvel = character.default_qpos.float(), torch.zeros(character.model.nv)
    keys = character.key_positions(qpos)
    rest = character_state(character, qpos, qvel, keys)
    assert (parts.keys.stop, *rest.shape) == (120, 120)
    changed = {
        "height": (qpos + torch.eye(len(qpos))[2], qvel, keys + torch.eye(3)[2]),
        "linear": (qpos, torch.eye(len(qvel))[1], keys),
        "angular": (qpos, torch.eye(len(qvel))[4], keys),
        "joint_velocities": (qpos, torch.eye(len(qvel))[6], keys),
        "keys": (qpos, qvel, keys + 1.0),
    }
    for name, (q, v, k) in changed.items():
        differs = (character_state(character, q, v, k) != rest).nonzero().flatten()
        own = getattr(parts, name)
        assert own.start <= differs.min() <= differs.max() < own.stop, name


def test_who_does_what_the_clip_does_earns_everything(character, library, generator):
    follower, _ = tracker(character, library, [KICK])
    follower.begin(torch.tensor([0]), torch.tensor([KICK]), torch.tensor([0.5], dtype=torch.float64))
    for step in range(1, 30):
        reward, lost = follower.step(at(library, KICK, 0.5 + step * CONTROL_DT), generator)
        assert reward.item() == pytest.approx(1.0, abs=1e-4)
        assert not lost
    late, _ = follower.step(at(library, KICK, 0.5 + 25 * CONTROL_DT), generator)
    assert late.item() < 0.9


@pytest.mark.parametrize("part", ["height", "rotation", "linear", "angular", "joints", "keys"])
def test_every_part_of_the_state_counts_but_the_joints_velocities(character, library, generator, part: str):
    rewards = []
    for columns in (getattr(state_parts(character), part), state_parts(character).joint_velocities):
        follower, _ = tracker(character, library, [GUARD])
        follower.begin(torch.tensor([0]), torch.tensor([GUARD]), torch.full((1,), 2.0, dtype=torch.float64))
        state = at(library, GUARD, 2.0 + CONTROL_DT).clone()
        state[:, columns] += 1.0
        rewards.append(follower.step(state, generator)[0].item())
    assert rewards[0] < 0.95
    assert rewards[1] == pytest.approx(1.0, abs=1e-4)


def test_a_clip_waits_for_who_is_behind_and_pays_less(character, library, generator):
    follower, _ = tracker(character, library, [KICK])
    follower.begin(torch.tensor([0]), torch.tensor([KICK]), torch.tensor([0.5], dtype=torch.float64))
    stays = at(library, KICK, 0.5)
    paid = [follower.step(stays, generator)[0].item() for _ in range(20)]
    waits = follower.state_dict()["time"].item()
    assert waits < 0.5 + 3.5 * CONTROL_DT
    assert paid[-1] < 0.4
    late, _ = follower.step(at(library, KICK, waits + CONTROL_DT), generator)
    assert late.item() > 0.95  # that goes on, twenty steps late; only its heading is not what it would be
    assert follower.progress[0, [0, 2, 3]].tolist() == pytest.approx([1.0] * 3, abs=1e-3)


def test_who_makes_a_clip_wait_for_too_long_has_lost_it(character, library, generator):
    follower, _ = tracker(character, library, [KICK, KICK], patience=0.5)
    follower.begin(torch.arange(2), torch.tensor([KICK, KICK]), torch.full((2,), 0.5, dtype=torch.float64))
    stays, lost = at(library, KICK, 0.5), []
    for step in range(40):
        if step == 10:  # the second goes on for a while, which is counted
            for more in range(1, 6):
                follower.step(torch.cat((stays, at(library, KICK, 0.6 + more * CONTROL_DT))), generator)
        time = follower.state_dict()["time"][1].item()
        lost.append(follower.step(torch.cat((stays, at(library, KICK, time))), generator)[1])
    first, second = torch.stack(lost).long().argmax(0).tolist()
    assert first * CONTROL_DT < 0.6
    assert second > first


def test_how_long_a_clip_has_waited_is_a_part_of_the_state(character, library, generator):
    stays, states = at(library, KICK, 0.5), []
    for saved in (None, 10):
        follower, _ = tracker(character, library, [KICK], patience=0.5)
        follower.begin(torch.tensor([0]), torch.tensor([KICK]), torch.tensor([0.5], dtype=torch.float64))
        for step in range(14):
            if step == saved:
                state, progress = follower.state_dict(), follower.progress
                follower, _ = tracker(character, library, [KICK], patience=0.5)
                follower.load_state_dict(state)
                assert torch.equal(follower.progress, progress)
            follower.step(stays, generator)
        states.append(follower.state_dict())
    assert states[0]["held"] > 0.3
    assert all(torch.equal(states[0][name], states[1][name]) for name in states[0])


def test_a_clip_hurries_after_who_is_ahead(character, library, generator):
    follower, _ = tracker(character, library, [KICK])
    follower.begin(torch.tensor([0]), torch.tensor([KICK]), torch.tensor([0.5], dtype=torch.float64))
    paid = [follower.step(at(library, KICK, 0.75 + step * CONTROL_DT), generator)[0].item() for step in range(1, 10)]
    assert paid[0] < 0.6
    assert paid[-1] > 0.9  # it need not be there to the last step


@pytest.mark.parametrize("clip", [KICK, TAUNT])
def test_who_stands_still_is_behind_wherever_in_the_clip(character, library, generator, clip: int):
    """A clip that went on by what is nearest a step away would pay it, since no step makes it much worse."""
    begins = torch.arange(0.4, library.duration[clip].item() - 0.5, 0.1, dtype=torch.float64)
    follower, _ = tracker(character, library, [clip] * len(begins))
    follower.begin(torch.arange(len(begins)), torch.full((len(begins),), clip), begins)
    stays = library.frames(torch.full((len(begins),), clip), begins, 1)[:, 0]
    stays[:, 7:13] = 0.0
    lost = torch.stack([follower.step(stays, generator)[1] for _ in range(60)])
    assert lost.any(0).float().mean() > 0.9
    follower, _ = tracker(character, library, [GUARD])  # unless the clip itself stands still
    follower.begin(torch.tensor([0]), torch.tensor([GUARD]), torch.tensor([1.5], dtype=torch.float64))
    stays = at(library, GUARD, 1.5)
    assert not any(follower.step(stays, generator)[1] for _ in range(60))


def test_critics_are_shown_what_following_pays_for_and_no_state_shows(character, library, generator):
    follower, _ = tracker(character, library, [KICK])
    follower.begin(torch.tensor([0]), torch.tensor([KICK]), torch.tensor([0.5], dtype=torch.float64))
    assert follower.progress.shape == (1, PROGRESS_SIZE)
    follower.step(at(library, KICK, 0.5 + CONTROL_DT), generator)
    near = follower.progress[0]
    assert near[:4].tolist() == pytest.approx([1.0] * 4, abs=1e-3)
    assert near[4].item() == pytest.approx(0.0, abs=1e-3)
    assert near[5:7].square().sum().item() == pytest.approx(1.0)
    assert near[7:9].tolist() == [0.0, 0.0]
    assert near[9].item() == pytest.approx(0.0, abs=1e-3)
    for _ in range(8):
        reward, _ = follower.step(at(library, KICK, 0.5), generator)
    waits = follower.progress[0]
    assert waits[7] > 3 * CONTROL_DT
    assert (waits[:4] * torch.tensor([0.4, 0.2, 0.2, 0.2])).sum().item() * 0.3 == pytest.approx(reward.item())
    follower.turn(torch.tensor([0]), generator)
    assert follower.progress[0, 8].item() == pytest.approx(1.0)  # of patience


@pytest.fixture(scope="module")
def turning(character: Character) -> MotionLibrary:
    return MotionLibrary(load_clips("builtin", character, ["turn_left_90"]), character)


def turn(character: Character, turning: MotionLibrary, spin: float, generator: torch.Generator, **changes: Any):
    """Rewards, losses and deviations of who does all that a turn does from 0.4 s on, at `spin` [rad/s] more."""
    follower, _ = tracker(character, turning, [0], **changes)
    follower.begin(torch.tensor([0]), torch.tensor([0]), torch.tensor([0.4], dtype=torch.float64))
    told = []
    for step in range(1, 37):
        state = at(turning, 0, 0.4 + step * CONTROL_DT).clone()
        state[:, state_parts(character).angular][:, 2] += spin
        reward, lost = follower.step(state, generator)
        told.append((reward.item(), lost.item(), follower.progress[0, -1].item()))
    return [list(column) for column in zip(*told, strict=True)]


def test_who_turns_more_or_less_than_the_clip_earns_less_and_less_and_has_lost_it(character, turning, generator):
    exact, losses, deviation = turn(character, turning, 0.0, generator)
    assert min(exact) > 0.99
    assert not any(losses)
    assert max(map(abs, deviation)) < 0.02
    for spin in (-0.9, 0.9):
        rewards, losses, deviation = turn(character, turning, spin, generator)
        assert rewards[-1] < rewards[0] - 0.1
        # of a constant error all but e^-t is remembered after t seconds
        after = [spin * (1 - np.exp(-step * CONTROL_DT)) for step in range(1, 37)]
        assert deviation == pytest.approx(after, abs=0.05)
        assert losses == [abs(turned) > 0.6 for turned in deviation]
        assert losses[-1]
    assert not any(turn(character, turning, -0.9, generator, turned=1.0)[1])


def test_a_deviation_of_the_heading_is_forgotten(character, turning, generator):
    follower, _ = tracker(character, turning, [0], turned=9.0)
    follower.begin(torch.tensor([0]), torch.tensor([0]), torch.tensor([0.4], dtype=torch.float64))
    state = at(turning, 0, 0.4 + CONTROL_DT).clone()
    state[:, state_parts(character).angular][:, 2] += 6.0
    follower.step(state, generator)
    first = follower.progress[0, -1].item()
    assert first == pytest.approx(6.0 * CONTROL_DT, abs=0.02)
    for step in range(2, 32):
        follower.step(at(turning, 0, 0.4 + step * CONTROL_DT), generator)
    assert follower.progress[0, -1].item() == pytest.approx(first / np.e, abs=0.02)
    follower.turn(torch.tensor([0]), generator)
    assert follower.progress[0, -1].item() == 0.0


def test_what_a_clip_says_nothing_of_is_left_out(character, generator):
    clips = load_clips("builtin", character, ["guard"])
    bare = MotionLibrary([dataclasses.replace(clip, masked=("sword",)) for clip in clips], character)
    sword = state_parts(character).keys.start + 3 * character.key_bodies.index("sword")
    rewards = []
    for library in (MotionLibrary(clips, character), bare):
        follower, _ = tracker(character, library, [0])
        follower.begin(torch.tensor([0]), torch.tensor([0]), torch.full((1,), 2.0, dtype=torch.float64))
        state = at(library, 0, 2.0 + CONTROL_DT).clone()
        state[:, sword] += 1.0
        rewards.append(follower.step(state, generator)[0].item())
    assert rewards[0] < 0.9
    assert rewards[1] == pytest.approx(1.0, abs=1e-4)


def test_who_is_far_from_the_clip_has_lost_it(character, library, generator):
    follower, _ = tracker(character, library, [GUARD], lost=0.2)
    follower.begin(torch.tensor([0]), torch.tensor([GUARD]), torch.tensor([1.0], dtype=torch.float64))
    parts, state = state_parts(character), at(library, GUARD, 1.0 + CONTROL_DT).clone()
    state[:, parts.keys.start] += 6 * 0.19  # one key point of six
    assert not follower.step(state, generator)[1]
    state[:, parts.keys.start] += 6 * 0.03
    assert follower.step(state, generator)[1]


def test_a_skill_that_is_commanded_anew_waits_for_the_character_at_its_beginning(character, library, generator):
    follower, skills = tracker(character, library, [GUARD], patience=0.5, near=0.15, lost=0.1)
    follower.begin(torch.tensor([0]), torch.tensor([GUARD]), torch.tensor([1.0], dtype=torch.float64))
    follower.step(at(library, GUARD, 1.0 + CONTROL_DT), generator)
    skills.command("kick")
    far = at(library, KICK, 0.0).clone()
    far[:, state_parts(character).keys] += 0.3
    for _ in range(5):
        reward, lost = follower.step(far, generator)
        assert not lost  # it may come from anywhere
        assert reward < 0.9
    follower.step(at(library, KICK, 0.0), generator)  # here it is: the clip begins
    rest = follower.state_dict()["time"].item()
    assert 0.05 < rest < 0.3  # which is passed over
    for step in range(1, 20):
        reward, _ = follower.step(at(library, KICK, rest + step * CONTROL_DT), generator)
        assert reward.item() == pytest.approx(1.0, abs=1e-4)


def test_patience_ends(character, library, generator):
    follower, _ = tracker(character, library, [KICK], patience=0.5, lost=0.1)
    follower.turn(torch.tensor([0]), generator)
    far = at(library, KICK, 0.0).clone()
    far[:, state_parts(character).keys] += 0.3
    lost = [bool(follower.step(far, generator)[1]) for _ in range(30)]
    assert 0.5 < lost.index(True) * CONTROL_DT < 0.5 + 0.35  # the clip has begun by then, and may have hurried


def test_at_its_end_a_clip_begins_again_or_gives_way_to_another(character, library, generator):
    for switch, expected in ((0.0, {GUARD}), (1.0, {GUARD, KICK, TAUNT})):
        follower, skills = tracker(character, library, [GUARD] * 60, switch=switch)
        late = library.duration[GUARD].repeat(60)
        follower.begin(torch.arange(60), torch.full((60,), GUARD), late)  # which is rest: its last step before that
        last = follower.state_dict()["time"][0].item() + CONTROL_DT
        assert library.duration[GUARD] - 1.0 < last < library.duration[GUARD] - 0.1
        follower.step(at(library, GUARD, last).expand(60, -1), generator)
        assert set(skills.current.tolist()) == expected
        stayed = skills.current == GUARD
        time = follower.state_dict()["time"]
        assert ((time < 0) | (time > 0.1) & (time < 1.0)).all()  # on the way to a beginning, or behind its rest
        assert (time[~stayed] < 0).all()
        reward, _ = follower.step(at(library, GUARD, last + CONTROL_DT).expand(60, -1), generator)
        assert (reward[stayed & (time > 0.0)] > 0.6).all()


def test_the_guide_leads_the_pd_control_along_the_clip():
    """Its targets are ahead of the pose by the lag, so that the joints keep up; those of the next pose are behind.

    By a tenth and more: the clip waits for whom the guide leads too slowly.
    """
    behind = []
    for lead in (True, False):
        env = make(60, starts=UPRIGHT, tracking={"follow": True, "switch": 0.0, "lost": 9.0})
        env.reset(seed=1)
        assert env._tracker is not None
        begun, error = env._tracker.state_dict(), []
        for step in range(1, 13):
            now = env.library.pose(begun["clip"], begun["time"] + step * CONTROL_DT)[0]
            env.step(env.guide() if lead else env.character.action_for(now).numpy())
            there = env.character.joint_coordinates(now)
            error.append((env.character.joint_coordinates(env.state.qpos) - there).abs().mean().item())
        behind.append(sum(error))
    assert behind[0] < 0.9 * behind[1]


def test_the_guide_leads_further_the_longer_a_clip_has_waited():
    env = make(6, starts=UPRIGHT, tracking={"follow": True, "lost": 9.0}, residual_force=50.0)
    env.reset(seed=1)
    assert env._tracker is not None
    character, state = env.character, env._tracker.state_dict()
    pulled = env.guide()[:, 31:]
    arms = torch.zeros(31, dtype=torch.bool)
    for joint in character.joints:
        arms[joint.action] = joint.name.endswith(("shoulder", "elbow"))
    state["held"][:3] = 0.4
    env._tracker.load_state_dict(state)
    for worlds, ahead in ((slice(0, 3), character.lag + 0.4), (slice(3, 6), character.lag)):
        expected = character.action_for(env._tracker.wanted(ahead)[0])[worlds]
        np.testing.assert_allclose(env.guide()[worlds, :31][:, arms], expected[:, arms], atol=1e-6)
    further = np.abs(env.guide()[:, 31:] - pulled).max(-1)
    assert (further[:3] > 0.01).all()
    assert (further[3:] == 0.0).all()


def test_with_residual_forces_the_guide_keeps_balance():
    lengths = []
    for newtons in (0.0, 50.0):
        env = make(
            30, starts=UPRIGHT, tracking={"follow": True, "lost": 9.0}, residual_force=newtons, autoreset="same_step"
        )
        env.reset(seed=1)
        standing = np.ones(30, bool)
        for _ in range(150):
            _, _, terminated, _, _ = env.step(env.guide())
            standing &= ~terminated
        lengths.append(standing.mean())
    assert lengths[0] < 0.7
    assert lengths[1] == 1.0


def test_the_guide_pulls_each_body_to_where_the_clip_has_it():
    env = make(3, starts=UPRIGHT, tracking={"follow": True}, residual_force=50.0)
    env.reset(seed=4)
    rest = env.guide()[:, 31:]
    qpos, qvel = env.state.qpos.clone(), env.state.qvel.clone()
    qpos[:, 2] += 0.01
    env.physics.write(torch.arange(3), qpos, qvel)
    pulled = (env.guide()[:, 31:] - rest).reshape(3, 15, 3)
    np.testing.assert_allclose(pulled[..., 2], -0.1, atol=1e-5)  # of 50 N: 500 N/m over 1 cm
    np.testing.assert_allclose(pulled[..., :2], 0.0, atol=1e-5)
    qpos[:, 2] -= 0.01
    qvel[:, 2] += 0.1
    env.physics.write(torch.arange(3), qpos, qvel)
    slowed = (env.guide()[:, 31:] - rest).reshape(3, 15, 3)
    np.testing.assert_allclose(slowed[..., 2], -0.1, atol=1e-5)  # 50 N s/m
    qpos, qvel = env.state.qpos.clone(), env.state.qvel.clone()
    turn = torch.tensor([np.cos(0.5), 0.0, 0.0, np.sin(0.5)])
    w, z = turn[0], turn[3]
    a, b, c, d = qpos[:, 3:7].unbind(-1)
    qpos[:, 3:7] = torch.stack((w * a - z * d, w * b - z * c, w * c + z * b, w * d + z * a), -1)
    x, y = qvel[:, 0].clone(), qvel[:, 1].clone()
    cosine, sine = np.cos(1.0), np.sin(1.0)
    qvel[:, 0], qvel[:, 1] = cosine * x - sine * y, sine * x + cosine * y
    qpos[:, :2] += 3.0
    env.physics.write(torch.arange(3), qpos, qvel)
    moved = env.guide()[:, 31:].reshape(3, 15, 3)
    np.testing.assert_allclose(moved, (slowed + rest.reshape(3, 15, 3)), atol=1e-4)  # neither place nor heading counts


def test_the_guide_stands_on_the_ground_that_there_is():
    """What the forces do; of the joints' targets see test_balance."""
    env = make(3, starts=UPRIGHT, tracking={"follow": True}, residual_force=50.0)
    env.reset(seed=4)
    assert env._guide is not None
    level = env._guide.action(env.state)[:, 31:]
    qpos = env.state.qpos.clone()
    qpos[:, 2] += 0.1
    env.physics.write(torch.arange(3), qpos, env.state.qvel.clone())
    raised = env._guide.action(env.state, torch.full((3,), 0.1, dtype=torch.float64))[:, 31:]
    torch.testing.assert_close(raised, level, atol=1e-4, rtol=0)


def test_the_environment_pays_for_following_and_ends_what_is_lost():
    env = make(30, starts=UPRIGHT, tracking={"follow": True, "lost": 0.5})
    obs, _ = env.reset(seed=0)
    assert set(obs["skill"]) == {GUARD, KICK, TAUNT}
    held = np.zeros((30, 31), np.float32)
    _, _, terminated, _, info = env.step(held)
    assert 0.2 < info["side_rewards"]["tracking"].mean() <= 1.0
    assert not terminated.any()
    strict = make(30, starts=UPRIGHT, tracking={"follow": True, "lost": 0.001})
    strict.reset(seed=0)
    for _ in range(15):
        _, _, terminated, _, info = strict.step(held)
    assert terminated.any()
    assert not info["fall"].any()


def test_nothing_is_followed_unless_asked_for():
    env = make(2)
    env.reset(seed=0)
    info = env.step(np.zeros((2, 31), np.float32))[-1]
    assert "side_rewards" not in info
    with pytest.raises(SuiteError, match=r"tracking.follow=false: there is no guide where no clip is followed"):
        env.guide()


def test_following_goes_on_from_a_saved_state_bit_for_bit(generator):
    actions = torch.rand(80, 12, 31, generator=generator) * 0.2 - 0.1
    starts = {**UPRIGHT, "commanded": 0.5, "adaptive": 0.5}
    runs = []
    for saved in (False, True):
        env = make(12, starts=starts, tracking={"follow": True}, episode_steps=40)
        env.reset(seed=3)
        for action in actions[:30]:
            env.step(action.numpy())
        if saved:
            state = env.state_dict()
            env = make(12, starts=starts, tracking={"follow": True}, episode_steps=40)
            env.reset(seed=9)
            env.load_state_dict(state)
        steps = [env.step(action.numpy()) for action in actions[30:]]
        runs.append([(obs["skill"], info["side_rewards"]["tracking"], end) for obs, _, end, _, info in steps])
    for plain, resumed in zip(*runs, strict=True):
        for a, b in zip(plain, resumed, strict=True):
            assert np.array_equal(a, b)


@pytest.mark.parametrize(
    ("tracking", "said"),
    [
        ({"lost": -1.0}, "tracking.lost=-1.0: needs at least 0"),
        ({"patience": float("nan")}, "tracking.patience=nan"),
        ({"turned": -0.1}, "tracking.turned=-0.1: needs at least 0"),
        ({"switch": 1.5}, "tracking.switch=1.5: needs a probability"),
    ],
)
def test_settings_that_cannot_be(tracking: dict[str, float], said: str):
    with pytest.raises(SuiteError, match=said):
        make(1, tracking=tracking)


def test_links_are_not_followed():
    with pytest.raises(SuiteError, match=r"tracking.follow=true: needs features=character"):
        make(1, features="links", tracking={"follow": True})
