"""CALM on the toy: the policy goes the way of the motion whose encoding it is given, and the encoder learns from it."""

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.calm.config import EncoderConfig
from murmillo.agents.calm.losses import alignment_loss, uniformity_loss
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latents import interpolate, sample_sphere
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.ranks import ALONE, Part
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import DT, MOTION_FRAMES, SPEED, PointMass, equal, make_calm, make_runner, small_calm


def calm_runner(folder: Path, **settings: Any) -> Runner:
    return make_runner(folder, make=make_calm, **{"reward_weights": {"style": 1.0}, **settings})


def straight(angles: Tensor) -> Tensor:
    """Motions [n, MOTION_FRAMES, 4] straight ahead from the origin, in these directions [n] [rad]."""
    velocity = SPEED * torch.stack([angles.cos(), angles.sin()], 1)
    position = DT * torch.arange(MOTION_FRAMES)[None, :, None] * velocity[:, None]
    return torch.cat([position, velocity[:, None].expand_as(position)], 2)


def test_the_policy_follows_the_encoded_motion(tmp_path: Path) -> None:
    runner = calm_runner(tmp_path, num_envs=64, samples=64 * 8 * 60, agent={"negatives": "shuffled"})
    calm: Any = runner.agent
    angles = torch.arange(8) * torch.pi / 4

    def cosine() -> float:
        """Of the angle between the motion that is asked for and the velocity that the policy takes up at the origin."""
        asked, start = straight(angles), torch.zeros(8, 4)
        action, _ = calm.model.act(start, calm.encode(asked))
        return torch.cosine_similarity(action, asked[:, 0, 2:]).mean().item()

    before = cosine()
    runner.run()
    assert before < 0.5
    assert cosine() > 0.7


def test_encodings_have_unit_length_and_depend_on_every_frame_that_is_seen(generator: torch.Generator) -> None:
    env = PointMass(3)
    encoder = EncoderConfig(frames=MOTION_FRAMES, stride=2, hidden=(16,), shift=0, minibatch=8, pool=64)
    calm = make_calm(env, generator, encoder=encoder)
    motion = torch.randn(5, MOTION_FRAMES, 4, generator=generator)
    z = calm.encode(motion)
    torch.testing.assert_close(z.norm(dim=1), torch.ones(5))
    for frame in range(MOTION_FRAMES):
        changed = motion.clone()
        changed[:, frame] += 1.0
        assert torch.equal(calm.encode(changed), z) == (frame % 2 == 0)  # seen are 5, 3 and 1


def test_the_policys_loss_trains_the_encoder_and_the_discriminators_does_not(tmp_path: Path) -> None:
    plain = EncoderConfig(
        frames=MOTION_FRAMES, hidden=(16,), shift=0, alignment_weight=0.0, uniformity_weight=0.0, minibatch=8, pool=64
    )
    still = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=0.0, epochs=1, minibatch=64)
    moving = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=1e-3, epochs=1, minibatch=64)
    for ppo, moves in ((still, False), (moving, True)):
        runner = calm_runner(tmp_path / str(moves), samples=1, agent={"encoder": plain, "ppo": ppo})
        calm: Any = runner.agent
        before = [parameter.clone() for parameter in calm.encoder.parameters()]
        judge = [parameter.clone() for parameter in calm.discriminator.parameters()]
        runner.run()
        assert moves != all(torch.equal(a, b) for a, b in zip(before, calm.encoder.parameters(), strict=True))
        assert not any(torch.equal(a, b) for a, b in zip(judge, calm.discriminator.parameters(), strict=True))


def test_log_probabilities_belong_to_the_encoder_of_the_iteration(tmp_path: Path) -> None:
    """At the first minibatch of an update the policy is the one that acted, also for motions begun long before."""
    one_step = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=1e-2, epochs=1, minibatch=256)
    runner = calm_runner(tmp_path, samples=32 * 8 * 5, agent={"ppo": one_step, "latent_steps": (50, 60)})
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    runner.run()
    assert all(abs(stats["ppo/kl"]) < 1e-6 for stats in history)


@pytest.mark.parametrize("negatives", ["sphere", "shuffled", "none"])
def test_negatives_are_a_part_of_the_discriminators_loss_or_not(tmp_path: Path, negatives: str) -> None:
    runner = calm_runner(tmp_path, samples=1, agent={"negatives": negatives})
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    runner.run()
    assert ("discriminator/negative" in history[0]) == (negatives != "none")


def test_masked_features_of_a_motion_reach_neither_encoder_nor_discriminator(tmp_path: Path) -> None:
    class Masked(PointMass):
        noise = 0.0

        def demonstrations(self, *args: Any, **kwargs: Any) -> dict[str, Tensor]:
            drawn = super().demonstrations(*args, **kwargs)
            drawn["window"][..., 0] += self.noise  # made up, and so of no consequence
            mask = torch.tensor([True, False, False, False]).expand(len(drawn["skill"]), 4)
            return drawn | {"mask": mask}

    states = []
    for noise in (0.0, 7.0):
        generator = torch.Generator().manual_seed(0)
        env = Masked(16)
        env.noise = noise
        calm = make_calm(env, generator)
        Runner(
            env, calm, RunnerConfig(samples=16 * 8 * 3, horizon=8, reward_weights={"style": 1.0}), generator, tmp_path
        ).run()
        states.append({key: calm.state_dict()[key] for key in ("ppo", "discriminator", "encoder")})
    assert equal(*states)


def test_a_world_leaves_out_what_its_own_motion_leaves_out(generator: torch.Generator) -> None:
    env = PointMass(20)
    whole = env.demonstrations

    def masked_to_the_right(*args: Any, **kwargs: Any) -> dict[str, Tensor]:
        drawn = whole(*args, **kwargs)
        mask = torch.zeros(len(drawn["skill"]), 4, dtype=torch.bool)
        mask[:, 1] = drawn["window"][:, -1, 2] > 0
        return drawn | {"mask": mask}

    env.demonstrations = masked_to_the_right  # type: ignore[method-assign]
    calm = make_calm(env, generator, latent_steps=(1, 3))
    obs = tensors(env.reset(seed=0)[0])
    for _ in range(10):
        extras = calm.act(obs).extras
        followed = calm.motions.of(extras["motion"])
        torch.testing.assert_close(calm.encoder(followed).detach(), extras["latent"])
        assert torch.equal(extras["mask"][:, 1], followed.window[:, -1, 2] > 0)
    assert 0 < extras["mask"][:, 1].sum() < 20


def test_true_windows_lie_in_the_motion_whose_encoding_they_are_judged_by(generator: torch.Generator) -> None:
    env = PointMass(2)
    encoder = EncoderConfig(frames=MOTION_FRAMES, hidden=(16,), shift=2, minibatch=64, pool=64)
    calm = make_calm(env, generator, encoder=encoder)
    pool = calm._draw_motions(64, MOTION_FRAMES + 2)
    drawn = calm._encoded_demonstration(pool, Part(ALONE, 64))
    encodings = calm.encode(pool.window[:, 2:])
    assert drawn.condition is not None
    beginnings = set()
    for window, z in zip(drawn.window, drawn.condition, strict=True):
        motion = pool.window[(encodings - z).norm(dim=1).argmin(), 2:]
        torch.testing.assert_close(z, calm.encode(motion[None])[0])
        (first,) = [i for i in range(MOTION_FRAMES - 2) if torch.equal(motion[i : i + 3], window)]
        beginnings.add(first)
    assert beginnings == set(range(MOTION_FRAMES - 2))


def test_a_negative_is_a_true_window_under_anothers_latent(generator: torch.Generator) -> None:
    calm = make_calm(PointMass(2), generator, negatives="shuffled")
    true = calm._encoded_demonstration(calm._draw_motions(64, MOTION_FRAMES + 2), Part(ALONE, 64))
    negative = calm._negative(true)
    assert negative is not None
    assert true.condition is not None
    assert negative.condition is not None
    assert torch.equal(negative.window, true.window)
    assert (negative.condition != true.condition).any(1).float().mean() > 0.9
    assert torch.equal(negative.condition.sort(0).values, true.condition.sort(0).values)
    calm.config.negatives = "sphere"
    anywhere = calm._negative(true)
    assert anywhere is not None
    assert anywhere.condition is not None
    torch.testing.assert_close(anywhere.condition.norm(dim=1), torch.ones(64))
    assert (anywhere.condition.sort(0).values != true.condition.sort(0).values).all()


def test_structure_pulls_neighbours_together_and_all_apart(tmp_path: Path) -> None:
    runner = calm_runner(tmp_path, samples=1)
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    runner.run()
    assert history[0]["ppo/alignment"] > 0 > history[0]["ppo/uniformity"]


def test_the_mismatched_score_is_of_the_same_windows_under_others_latents(generator: torch.Generator) -> None:
    calm = make_calm(PointMass(2), generator, negatives="shuffled")
    right = calm._encoded_demonstration(calm._draw_motions(64, MOTION_FRAMES + 2), Part(ALONE, 64))
    wrong = calm._negative(right)
    assert wrong is not None
    score = calm._mismatched_score(right)
    torch.testing.assert_close(score, calm.discriminator.logits(*wrong[:3]).sigmoid().mean())
    assert score != calm.discriminator.logits(*right[:3]).sigmoid().mean()


def test_a_player_remembers_no_more_than_it_follows(generator: torch.Generator) -> None:
    env = PointMass(4)
    calm = make_calm(env, generator, latent_steps=(1, 1))
    obs = tensors(env.reset(seed=0)[0])
    numbers = [calm.act(obs, deterministic=True).extras["motion"].max() for _ in range(20)]
    assert max(numbers) < 2 * 4
    before = calm.motions.of(torch.arange(4)).window
    assert len(before) == 4


def test_resumed_training_is_the_same_bit_for_bit(tmp_path: Path) -> None:
    whole = calm_runner(tmp_path / "whole", samples=32 * 8 * 6)
    whole.run()
    calm_runner(tmp_path / "half", samples=32 * 8 * 3).run()
    resumed = calm_runner(tmp_path / "half", samples=32 * 8 * 6)
    resumed.load(tmp_path / "half")
    resumed.run()
    assert equal(whole.agent.state_dict(), resumed.agent.state_dict())


def test_a_world_keeps_its_motion_for_the_asked_time(generator: torch.Generator) -> None:
    env = PointMass(4)
    calm = make_calm(env, generator, latent_steps=(3, 3))
    obs = tensors(env.reset(seed=0)[0])
    motions = torch.stack([calm.act(obs).extras["motion"] for _ in range(9)])
    changes = (motions[1:] != motions[:-1]).any(1).tolist()
    assert changes == [False, False, True, False, False, True, False, False]


def test_follows_what_it_is_told_until_reset(generator: torch.Generator) -> None:
    env = PointMass(4)
    calm = make_calm(env, generator, latent_steps=(1, 1))
    obs = tensors(env.reset(seed=0)[0])
    told = calm.encode(straight(torch.zeros(1)))[0]
    calm.follow(told)
    for _ in range(3):
        torch.testing.assert_close(calm.act(obs).extras["latent"], told.expand(4, -1))
    calm.reset(torch.tensor([2]))
    same = (calm.act(obs).extras["latent"] == told).all(1).tolist()
    assert same == [True, True, False, True]


def test_losses_by_hand() -> None:
    z = torch.tensor([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    other = torch.tensor([[1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert alignment_loss(z, other).item() == pytest.approx((0 + 2 + 4) / 3)
    pairs = torch.tensor([2.0, 4.0, 2.0])  # squared distances of the three pairs
    assert uniformity_loss(z).item() == pytest.approx((-2 * pairs).exp().mean().log().item())


def test_interpolation_stays_on_the_sphere_and_goes_evenly(generator: torch.Generator) -> None:
    a, b = sample_sphere(2, 8, generator)
    path = torch.stack([interpolate(a, b, t) for t in (0.0, 0.25, 0.5, 0.75, 1.0)])
    torch.testing.assert_close(path.norm(dim=-1), torch.ones(5))
    torch.testing.assert_close(path[[0, -1]], torch.stack([a, b]))
    steps = (path[1:] * path[:-1]).sum(-1)
    torch.testing.assert_close(steps, steps[:1].expand(4))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"negatives": "some"}, r"agent\.negatives=some is not one of sphere, shuffled, none"),
        ({"window": 70, "encoder": EncoderConfig()}, r"agent\.encoder\.frames=60: .* at least agent\.window=70"),
        ({"encoder": EncoderConfig(stride=0)}, r"stride=0 must be 1 to frames=60"),
        ({"encoder": EncoderConfig(frames=6, pool=50)}, r"agent\.encoder\.pool=50: .* at least 4096"),
    ],
)
def test_impossible_settings_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(AgentError, match=message):
        small_calm(**changes)
