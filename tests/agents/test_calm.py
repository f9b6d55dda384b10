"""CALM on the toy: the policy goes the way of the motion whose encoding it is given, and the encoder learns from it."""

from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from murmillo.agents.calm.agent import CALM
from murmillo.agents.calm.config import CALMConfig, EncoderConfig
from murmillo.agents.calm.losses import alignment_loss, uniformity_loss
from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.latents import interpolate, sample_sphere
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.rollout import tensors
from murmillo.agents.common.runner import Runner, RunnerConfig
from tests.agents.toy import SPEED, PointMass, equal

FRAMES = 6


def small_calm(**changes: Any) -> CALMConfig:
    ppo = PPOConfig(
        hidden=(32, 32),
        style_hidden=(),
        std=0.1,
        policy_learning_rate=1e-3,
        value_learning_rate=3e-3,
        epochs=4,
        minibatch=128,
    )
    discriminator = DiscriminatorConfig(
        hidden=(32, 32), learning_rate=1e-3, minibatch=64, updates=8, gradient_penalty=1.0, replay_size=1000
    )
    encoder = EncoderConfig(frames=FRAMES, hidden=(32, 32), shift=2, minibatch=64, pool=256)
    fields = {
        "latent_dim": 4,
        "latent_steps": (4, 16),
        "window": 3,
        "discriminator_style_hidden": (),
        "ppo": ppo,
        "discriminator": discriminator,
        "encoder": encoder,
    }
    return CALMConfig(**{**fields, **changes})


def make_runner(folder: Path, *, num_envs: int = 32, agent: dict | None = None, **config: Any) -> Runner:
    generator = torch.Generator().manual_seed(0)
    env = PointMass(num_envs)
    settings = {"samples": 32 * 8 * 4, "horizon": 8, "lam": 0.9, "gamma": 0.9, "reward_weights": {"style": 1.0}}
    calm = CALM(env, env.demonstrations, small_calm(**(agent or {})), generator)
    return Runner(env, calm, RunnerConfig(**{**settings, **config}), generator, folder)


def straight(angles: Tensor) -> Tensor:
    """Motions [n, FRAMES, 4] straight ahead from the origin, in these directions [n] [rad]."""
    velocity = SPEED * torch.stack([angles.cos(), angles.sin()], 1)
    position = 0.1 * torch.arange(FRAMES)[None, :, None] * velocity[:, None]
    return torch.cat([position, velocity[:, None].expand_as(position)], 2)


def test_the_policy_follows_the_encoded_motion(tmp_path: Path) -> None:
    runner = make_runner(tmp_path, num_envs=64, samples=64 * 8 * 60, agent={"negatives": "shuffled"})
    calm: Any = runner.agent
    angles = torch.arange(8) * torch.pi / 4

    def cosine() -> float:
        """Of the angle between the motion that is asked for and the velocity that the policy takes up at the origin."""
        asked, start = straight(angles), torch.zeros(8, 4)
        action, _ = calm.model.act(start, calm.encode(asked), runner.generator, deterministic=True)
        return torch.cosine_similarity(action, asked[:, 0, 2:]).mean().item()

    before = cosine()
    runner.run()
    assert before < 0.5
    assert cosine() > 0.7


def test_encodings_have_unit_length_and_depend_on_every_frame_that_is_seen(generator: torch.Generator) -> None:
    env = PointMass(3)
    encoder = EncoderConfig(frames=FRAMES, stride=2, hidden=(16,), shift=0, minibatch=8, pool=64)
    calm = CALM(env, env.demonstrations, small_calm(encoder=encoder), generator)
    motion = torch.randn(5, FRAMES, 4, generator=generator)
    z = calm.encode(motion)
    torch.testing.assert_close(z.norm(dim=1), torch.ones(5))
    for frame in range(FRAMES):
        changed = motion.clone()
        changed[:, frame] += 1.0
        assert torch.equal(calm.encode(changed), z) == (frame % 2 == 0)  # seen are 5, 3 and 1


def test_the_policys_loss_trains_the_encoder_and_the_discriminators_does_not(tmp_path: Path) -> None:
    plain = EncoderConfig(
        frames=FRAMES, hidden=(16,), shift=0, alignment_weight=0.0, uniformity_weight=0.0, minibatch=8, pool=64
    )
    still = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=0.0, epochs=1, minibatch=64)
    moving = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=1e-3, epochs=1, minibatch=64)
    for ppo, moves in ((still, False), (moving, True)):
        runner = make_runner(tmp_path / str(moves), samples=1, agent={"encoder": plain, "ppo": ppo})
        calm: Any = runner.agent
        before = [parameter.clone() for parameter in calm.encoder.parameters()]
        judge = [parameter.clone() for parameter in calm.discriminator.parameters()]
        runner.run()
        assert moves != all(torch.equal(a, b) for a, b in zip(before, calm.encoder.parameters(), strict=True))
        assert not all(torch.equal(a, b) for a, b in zip(judge, calm.discriminator.parameters(), strict=True))


def test_log_probabilities_belong_to_the_encoder_of_the_iteration(tmp_path: Path) -> None:
    """At the first minibatch of an update the policy is the one that acted, also for motions begun long before."""
    one_step = PPOConfig(hidden=(8,), style_hidden=(), policy_learning_rate=1e-2, epochs=1, minibatch=256)
    runner = make_runner(tmp_path, samples=32 * 8 * 5, agent={"ppo": one_step, "latent_steps": (50, 60)})
    history: list[dict[str, float]] = []
    runner.on_iteration = [history.append]
    runner.run()
    assert all(abs(stats["ppo/kl"]) < 1e-6 for stats in history)


@pytest.mark.parametrize("negatives", ["sphere", "shuffled", "none"])
def test_negatives_are_a_part_of_the_discriminators_loss_or_not(tmp_path: Path, negatives: str) -> None:
    runner = make_runner(tmp_path, samples=1, agent={"negatives": negatives})
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
        calm = CALM(env, env.demonstrations, small_calm(), generator)
        Runner(
            env, calm, RunnerConfig(samples=16 * 8 * 3, horizon=8, reward_weights={"style": 1.0}), generator, tmp_path
        ).run()
        states.append({key: calm.state_dict()[key] for key in ("ppo", "discriminator", "encoder")})
    assert equal(*states)


def test_resumed_training_is_the_same_bit_for_bit(tmp_path: Path) -> None:
    whole = make_runner(tmp_path / "whole", samples=32 * 8 * 6)
    whole.run()
    make_runner(tmp_path / "half", samples=32 * 8 * 3).run()
    resumed = make_runner(tmp_path / "half", samples=32 * 8 * 6)
    resumed.load(tmp_path / "half")
    resumed.run()
    assert equal(whole.agent.state_dict(), resumed.agent.state_dict())


def test_a_world_keeps_its_motion_for_the_asked_time(generator: torch.Generator) -> None:
    env = PointMass(4)
    calm = CALM(env, env.demonstrations, small_calm(latent_steps=(3, 3)), generator)
    obs = tensors(env.reset(seed=0)[0])
    motions = torch.stack([calm.act(obs).extras["motion"] for _ in range(9)])
    changes = (motions[1:] != motions[:-1]).any(1).tolist()
    assert changes == [False, False, True, False, False, True, False, False]


def test_follows_what_it_is_told_until_reset(generator: torch.Generator) -> None:
    env = PointMass(4)
    calm = CALM(env, env.demonstrations, small_calm(latent_steps=(1, 1)), generator)
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
