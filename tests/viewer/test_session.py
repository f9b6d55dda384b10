"""What a session is told reaches who acts, lasts over the ends of episodes, and is the same for the same seed."""

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch

from murmillo.agents.common.latents import interpolate
from murmillo.envs import SuiteError
from murmillo.viewer.latents import FAVOURITES
from murmillo.viewer.session import DOWN_STEPS, PUSH_STEPS, Session

Play = Callable[..., Session]


def steps(session: Session, n: int) -> None:
    for _ in range(n):
        session.step()


def label(session: Session) -> int:
    """The skill that the agent is told now."""
    return int(session.env.observation()["skill"][0])


# --- skills ----------------------------------------------------------------------------------------------------------


def test_a_commanded_skill_is_told_from_the_next_step_on_and_in_every_episode(play: Play) -> None:
    session = play("case")
    for skill in ("kick", "walk_forward"):
        session.command_skill(skill)
        session.step()
        assert session.look().status.skill == skill
        session.reset()
        assert label(session) == session.skills.index(skill)


def test_a_skill_that_is_left_to_chance_changes_with_the_episodes(play: Play) -> None:
    session = play("case")
    session.command_skill("kick")
    session.command_skill(None)
    labels = set()
    for _ in range(8):
        session.reset()
        labels.add(label(session))
    assert len(labels) > 2


def test_a_task_that_commands_skills_by_a_clock_commands_the_chosen_one(play: Play) -> None:
    session = play("case", "Direction")
    session.command_skill("kick")
    steps(session, 11)  # over two ends of the clock
    assert label(session) == session.env.skills.index("kick")


def test_who_has_learned_some_skills_is_told_no_others(play: Play) -> None:
    styles = ("run_forward", "walk_forward")
    session = play("calm", "Direction", styles=styles)
    assert session.skills == styles
    session.command_skill("run_forward")
    assert session.look().status.skill == "run_forward"
    session.command_skill(None)
    drawn = []
    for _ in range(12):
        session.reset()
        drawn.append(session.look().status.skill)
    assert set(drawn) == set(styles)


def test_a_session_begins_by_its_own_chances(play: Play) -> None:
    """Whatever has been drawn by in this world before."""
    play("case", "Direction").command_skill("kick")
    assert play("calm", "Direction", styles=("roar",)).look().status.skill == "roar"
    told = play("case", "Direction", seed=2)
    assert told.env.skills[label(told)] != "kick"


def test_who_heeds_no_label_has_none_to_offer(play: Play) -> None:
    session = play("ase")
    assert session.skills == ()
    assert session.look().status.skill is None


def test_a_skill_that_there_is_not(play: Play) -> None:
    with pytest.raises(SuiteError, match="skill=kik"):
        play("case").command_skill("kik")


# --- latents ---------------------------------------------------------------------------------------------------------


def test_a_drawn_latent_is_held_over_the_ends_of_episodes_until_it_is_left_to_chance(play: Play) -> None:
    session = play("ase")
    latents = session.latents
    assert latents is not None
    session.step()
    before = latents.current.clone()
    latents.draw()
    session.step()
    drawn = latents.current.clone()
    assert not torch.equal(drawn, before)
    session.reset()
    session.step()
    assert torch.equal(latents.current, drawn)
    latents.wander()
    session.step()
    assert not torch.equal(latents.current, drawn)
    assert latents.current.norm().item() == pytest.approx(1.0, abs=1e-5)


def test_the_action_follows_the_latent(play: Play) -> None:
    session = play("ase")
    latents = session.latents
    assert latents is not None
    session.step()
    poses = []
    state = session.env.state_dict()
    for name in (latents.keep(), None):
        session.env.load_state_dict(state)
        latents.follow(name) if name else latents.draw()
        session.step()
        poses.append(session.look().pose_w)
    assert not np.array_equal(*poses)


def test_favourites_can_be_blended_and_the_ninth_takes_the_place_of_the_first(play: Play) -> None:
    session = play("ase")
    latents = session.latents
    assert latents is not None
    kept = []
    for _ in range(FAVOURITES + 1):
        latents.draw()
        session.step()
        kept.append((latents.keep(), latents.current.clone()))
    assert list(latents.named) == [name for name, _ in kept[:FAVOURITES]]
    (last, ninth), (other, third) = kept[-1], kept[2]
    assert last == kept[0][0]
    latents.follow(last, other, 0.25)
    session.step()
    torch.testing.assert_close(latents.current, interpolate(ninth, third, 0.25))
    with pytest.raises(SuiteError, match="latent nobody"):
        latents.follow("nobody")


def test_calm_follows_the_encodings_of_clips(play: Play) -> None:
    session = play("calm")
    latents = session.latents
    assert latents is not None
    library = session.env.library
    assert list(latents.named) == [clip.name for clip in library.clips]
    agent = session._pilot.steerable
    assert agent is not None
    expected = agent.encode(library.middle(["kick"], agent.encoder.frames))[0]  # type: ignore[attr-defined] # CALM's
    latents.follow("kick")
    session.step()
    torch.testing.assert_close(latents.current, expected)


# --- pushes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("angle", [0.0, 0.5 * math.pi])
def test_a_push_moves_it_that_way_and_is_shown(play: Play, angle: float) -> None:
    velocity = {}
    for force in (0.0, 500.0):
        session = play("ase")
        x, y, z, w = (session.env.state.qpos[0, i].item() for i in (4, 5, 6, 3))
        turn = angle + math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        session.push(angle, force)
        assert len(session.look().markers) == 1
        steps(session, PUSH_STEPS)
        assert not session.look().markers
        velocity[force] = session.env.state.qvel[0, :2] @ torch.tensor(
            [math.cos(turn), math.sin(turn)], dtype=torch.float64
        )
    # 500 N for 0.2 s on 51.7 kg that stand on a floor; freely they would gain 1.9 m/s
    assert 0.5 < velocity[500.0] - velocity[0.0] < 3.0


def test_a_push_is_felt_beside_those_of_the_task(play: Play) -> None:
    poses = []
    for force in (0.0, 1000.0):
        session = play("ase", "Recovery")
        session.push(0.0, force)
        steps(session, 3)
        poses.append(session.look().pose_w)
    assert np.abs(poses[0] - poses[1]).max() > 0.01


# --- falls -----------------------------------------------------------------------------------------------------------


def fall(session: Session) -> None:
    """Push until it lies."""
    for _ in range(120):
        session.push(0.0, 1500.0)
        before = session.look().status.falls
        session.step()
        if session.look().status.falls > before:
            return
    raise AssertionError("it did not fall")


def test_a_fallen_character_is_left_in_sight_and_then_begins_anew(play: Play) -> None:
    session = play("ase")
    fall(session)
    before = session.look().status.seconds
    steps(session, DOWN_STEPS - 1)
    status = session.look().status
    assert status.seconds == pytest.approx(before + (DOWN_STEPS - 1) / 30)
    session.step()
    status = session.look().status
    assert (status.seconds, status.falls) == (0.0, 1)
    assert status.height > 0.6


def test_a_fallen_character_may_stay_down(play: Play) -> None:
    session = play("ase")
    session.stay_down = True
    fall(session)
    before = session.look().status.seconds
    steps(session, 2 * DOWN_STEPS)
    status = session.look().status
    assert status.seconds == pytest.approx(before + 2 * DOWN_STEPS / 30)
    assert status.falls == 1


def test_who_gets_up_again_goes_on(play: Play) -> None:
    session = play("ase")
    fall(session)
    qpos = session.env.state.qpos.clone()
    upright = session.env.character.default_qpos
    for _ in range(DOWN_STEPS):
        qpos[0, 2:] = upright[2:]
        session.env.physics.write(torch.zeros(1, dtype=torch.int64), qpos, torch.zeros_like(session.env.state.qvel))
        session.step()
    assert session.look().status.seconds > 1.0
    fall(session)


def test_an_end_of_the_task_begins_anew(play: Play, monkeypatch: pytest.MonkeyPatch) -> None:
    session = play("ase", "Location")
    session.goals.go_to(3.0, 4.0)
    steps(session, 2)
    monkeypatch.setattr(session.env.task, "terminated", lambda state: torch.ones(1, dtype=torch.bool))
    session.step()
    assert session.look().status.seconds == 0.0
    assert session.goals.now("target_w").tolist() == [3.0, 4.0]


# --- goals -----------------------------------------------------------------------------------------------------------


def test_a_goal_that_is_set_holds_until_another_is_drawn(play: Play) -> None:
    session = play("ase", "Steering")
    goals = session.goals
    assert goals.settable == ("direction_w", "facing_w", "speed")
    goals.move(0.5 * math.pi)
    goals.face(math.pi)
    goals.hasten(1.25)
    steps(session, 3)
    session.reset()
    assert goals.now("direction_w").tolist() == pytest.approx([0.0, 1.0])
    assert goals.now("facing_w").tolist() == pytest.approx([-1.0, 0.0])
    assert session.env.observation()["goal"][0, 2] == pytest.approx(1.25)
    goals.redraw()
    assert goals.now("speed").item() == 1.5  # the task's own
    session.reset()
    assert goals.now("facing_w").tolist() != pytest.approx([-1.0, 0.0])


def test_a_place_is_a_target_or_else_a_direction(play: Play) -> None:
    session = play("ase", "Location")
    session.goals.go_to(1.0, -2.0)
    assert session.look().markers[0].pos_w[:2] == [1.0, -2.0]
    session = play("ase", "Speed")
    x, y = session.env.state.qpos[0, :2].tolist()
    session.goals.go_to(x, y + 3.0)
    assert session.goals.now("direction_w").tolist() == pytest.approx([0.0, 1.0])
    session = play("ase", "Reach")
    height = session.goals.now("target_w")[2].item()
    session.goals.go_to(0.5, 0.25)
    assert session.goals.now("target_w").tolist() == [0.5, 0.25, height]


def test_a_goal_that_there_is_not(play: Play) -> None:
    env = play("ase", "Speed").env
    for wrong, named in (({"facing_w": torch.zeros(1, 2)}, "direction_w, speed"), ({"speed": torch.zeros(2)}, "(1,)")):
        with pytest.raises(SuiteError, match="goal") as refused:
            env.task.command(torch.zeros(1, dtype=torch.int64), **wrong)  # type: ignore[attr-defined] # Speed's
        assert named in str(refused.value)


# --- all of it -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "task"), [("ase", "Imitation"), ("calm", "Imitation"), ("case", "Location")])
def test_equal_seeds_and_commands_give_equal_frames(play: Play, name: str, task: str) -> None:
    frames = []
    for seed in (3, 3, 4):
        session = play(name, task, seed)
        steps(session, 4)
        session.push(1.0, 300.0)
        if session.latents is not None:
            session.latents.draw()
        session.goals.redraw()
        steps(session, 4)
        frames.append(session.look())
    assert np.array_equal(frames[0].pose_w, frames[1].pose_w)
    assert frames[0].status == frames[1].status
    assert not np.array_equal(frames[0].pose_w, frames[2].pose_w)


def test_a_policy_decides_every_few_steps_and_its_motion_is_judged(play: Play) -> None:
    session = play("ase", "Location")
    agent, heard = session._pilot.judge, []
    follow = agent.follow  # type: ignore[union-attr] # an ASE
    agent.follow = lambda latent: (heard.append(session.look().status.seconds), follow(latent))  # type: ignore[union-attr]
    steps(session, 11)
    assert heard == pytest.approx([0.0, 5 / 30, 10 / 30])
    status = session.look().status
    assert set(status.rewards) == {"position", "style", "skill"}
    assert status.score is not None
    assert status.score == pytest.approx(1.0 - math.exp(-status.rewards["style"]))


def test_a_policy_that_acts_itself_decides_every_step_and_is_judged_by_the_task_alone(play: Play) -> None:
    session = play("scratch", "Location")
    assert session.latents is None
    assert session.skills == ()
    policy, seen = session._pilot._policy, []  # type: ignore[attr-defined] # a PolicyPilot's
    act = policy.act
    policy.act = lambda obs, **how: (seen.append(obs["goal"].tolist()), act(obs, **how))[1]
    session.goals.go_to(3.0, 4.0)
    steps(session, 3)
    assert len(seen) == 3
    assert math.hypot(*seen[0][0]) == pytest.approx(5.0, abs=0.2)  # from where it stands, near the origin
    status = session.look().status
    assert set(status.rewards) == {"position"}
    assert status.score is None


def test_a_frame_has_the_bodies_and_then_the_props_and_is_not_changed_by_later_steps(play: Play) -> None:
    session = play("ase", "Strike")
    frame = session.look()
    assert frame.pose_w.shape == (len(session.env.character.bodies) + 1, 7)
    before = frame.pose_w.copy()
    np.testing.assert_array_equal(before[0, :3], session.env.state.qpos[0, :3])
    np.testing.assert_array_equal(before[-1], session.env.state.prop_qpos[0, 0])
    steps(session, 2)
    np.testing.assert_array_equal(frame.pose_w, before)
