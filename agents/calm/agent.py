"""CALM: conditional adversarial latent models (Tessler et al. 2023), its low-level training (section 5)."""

from typing import Any

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.calm.condition import LatentCondition
from murmillo.agents.calm.config import CALMConfig
from murmillo.agents.calm.encoder import MotionEncoder
from murmillo.agents.calm.losses import alignment_loss, uniformity_loss
from murmillo.agents.calm.motions import MotionSequence, cut, select
from murmillo.agents.common.base import Base, take_over
from murmillo.agents.common.blending import Blending
from murmillo.agents.common.dimensions import dimensions
from murmillo.agents.common.discriminator import Discriminator, Windows
from murmillo.agents.common.discriminator_loss import discriminator_loss
from murmillo.agents.common.interface import Demonstrations, Obs, Step
from murmillo.agents.common.latents import sample_sphere
from murmillo.agents.common.ppo import PPO, Minibatch, action_noise
from murmillo.agents.common.ranks import ALONE, Part, Ranks
from murmillo.agents.common.replay import Replay
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.skill_model import SkillModel
from murmillo.agents.common.training import Means, adam, load_parts, minimise, named, state_of


class CALM(Blending):
    """A policy pi(a | s, z) that follows the motion M whose encoding z = E(M) it is given.

    With a base it adapts that, and goes on following what the base's encoder makes of motions (`SkillModel`).
    """

    model: SkillModel

    def __init__(
        self,
        env: VectorEnv,
        demonstrations: Demonstrations,
        config: CALMConfig,
        generator: torch.Generator,
        base: Base | None = None,
        *,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            env: read for its spaces and number of worlds only.
            demonstrations: windows of the reference motions, of as many frames as asked for.
            config: hyperparameters.
            generator: draws weights, motions, noise and minibatches.
            base: the policy to adapt, with what gives its latents their meaning; None to train one from nothing.
            ranks: who train it together, each with an `env` of as many worlds.

        Raises:
            AgentError: environment or demonstrations give no windows of `config.window` frames,
                or the base is another agent's or of other sizes.
        """
        state_dim, action_dim = dimensions(env, demonstrations, config.window)
        self.config = config
        self.base = base is not None
        """Whether a base is adapted."""
        self.latent_dim = config.latent_dim
        self.demonstrations = demonstrations
        self.generator = generator
        self.ranks = ranks
        self.model = SkillModel(env, state_dim, action_dim, config.latent_dim, config, generator, base)
        self.needs = self.model.needs
        self.encoder = MotionEncoder(state_dim, config.latent_dim, config.encoder, generator)
        if base is not None:
            take_over(self.encoder, base, "encoder")
        self.ppo = PPO(self.model, config.ppo, self.encoder.parameters())
        self.noise = action_noise(config.ppo, generator, ranks)
        condition = LatentCondition(config.latent_dim, config.discriminator_style_hidden, generator)
        self.discriminator = Discriminator(
            config.window, state_dim, config.discriminator, generator, condition, ranks=ranks
        )
        self._observe_demonstrations()
        self.optimizer = adam((self.discriminator.parameters(), config.discriminator.learning_rate))
        self.replay = Replay(config.discriminator.replay_size, config.discriminator.replay_keep, ranks)
        self.motions = MotionSequence(
            env.num_envs, config.latent_dim, config.latent_steps, generator, self._draw_motions, self.encoder, ranks
        )
        self._parts = {
            "ppo": self.ppo,
            "noise": self.noise,
            "encoder": self.encoder,
            "discriminator": self.discriminator,
            "optimizer": self.optimizer,
            "replay": self.replay,
            "latents": self.motions,
        }

    @torch.no_grad()
    def encode(self, window: Tensor, mask: Tensor | None = None) -> Tensor:
        """z = E(M): latents `[B, Z]` of motions `[B, F, D]`, F = `config.encoder.frames`, oldest frame first.

        `mask` `[B, D]` bool is true for what a motion leaves out, as in training.
        """
        return self.encoder(Windows(window, mask=mask))

    @torch.no_grad()
    def draw_latents(self, n: int) -> Tensor:
        """Encodings `[n, Z]` of random motions."""
        return self.encoder(self._draw_motions(n))

    def draw_condition(self, label: Tensor) -> Tensor:
        """Encodings of random motions `[n, Z]` whatever the labels `[n]`, for a policy that is fitted to clips."""
        return self.draw_latents(len(label))

    def follow(self, latent: Tensor) -> None:
        self.motions.hold(latent)

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        """One step under the encodings of the motions that the worlds follow; the mean action if deterministic."""
        if deterministic:
            self.motions.forget()  # nothing is learnt from a mean action: a player keeps no more than it follows
        latent, motion = self.motions.step()
        told = self.model.told(latent, obs)
        action, log_prob = self.model.act(obs["state"], told, None if deterministic else self.noise)
        mask = self.motions.mask(motion)
        extras = {"latent": latent, "motion": motion}
        return Step(action, log_prob, extras if mask is None else extras | {"mask": mask}, self.noise.quiet)

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        return self.model.value(obs["state"], self.model.told(extras["latent"], obs))

    def reset(self, env_ids: Tensor) -> None:
        self.motions.reset(env_ids)

    @torch.no_grad()
    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """r = -log(1 - D(s, s' | z)) of eq. 4, `[T, N]`."""
        names = [name for name in ("next_window", "latent", "mask") if name in rollout]
        logits = [self.discriminator.logits(*row) for row in zip(*(rollout[name] for name in names), strict=True)]
        return {"style": self.discriminator.reward(torch.stack(logits))}

    def update(self, rollout: Rollout) -> dict[str, float]:
        """Eq. 7 for the discriminator; eq. 4 with eqs. 5 and 6 for policy, critic and encoder."""
        self._check_learning()
        config, generator, means = self.config, self.generator, Means()
        windows, latents = rollout.flat("next_window"), rollout.flat("latent")
        masks = rollout.flat("mask") if "mask" in rollout else None
        k = config.discriminator.minibatch
        pool = self._draw_motions(config.encoder.pool, config.encoder.frames + config.encoder.shift)

        for update in range(config.discriminator.updates):
            rows, part = rollout.draw(k, generator)
            mask = None if masks is None else masks[rows]
            agent = replay = Windows(windows.index_select(0, rows), latents[rows], mask, part)
            if len(self.replay):
                remembered, old = self.replay.sample(k, generator)
                replay = Windows(**remembered, part=old)
            demonstration = self._encoded_demonstration(pool, part)
            negative = self._negative(demonstration)
            loss = discriminator_loss(
                self.discriminator, agent, replay, demonstration, negative, generator=generator, update=update
            )
            minimise(self.optimizer, loss.parts, ranks=rollout.ranks)
            means.add({**loss.parts, **loss.scores})
        means.add({"agent_mismatched_score": self._mismatched_score(agent)})

        ppo = self.ppo.update(
            rollout,
            generator,
            fields=("motion", "latent", *self.model.seen),
            condition=lambda batch: self.model.tell(self._encode_batch(batch), batch),
            extra_loss=lambda batch, mean: self.model.penalties(batch),
            other_loss=lambda: {} if self.base else self._structure(pool),
        )
        remembered = {"window": windows, "condition": latents}
        self.replay.add(remembered if masks is None else remembered | {"mask": masks}, generator, rollout.part)
        self.discriminator.normalizer.update(rollout["next_state"], ranks=rollout.ranks)
        self._observe_demonstrations()
        self.motions.encode_again()
        return named("discriminator", means.result(rollout.ranks)) | named("ppo", ppo)

    def _encode_batch(self, batch: Minibatch) -> Tensor:
        """z = E(M) `[B, Z]` of a minibatch's motions, with gradient; each motion is encoded once.

        A base's encoder does not change, and its latents are those that acted.
        """
        if self.base:
            return batch["latent"]
        motions, row = batch["motion"].unique(return_inverse=True)
        return self.encoder(self.motions.of(motions))[row]

    def _structure(self, pool: Windows) -> dict[str, Tensor]:
        """Eqs. 5 and 6 on motions of the pool and their overlapping neighbours, of which each rank encodes a share."""
        config = self.config.encoder
        share = self.ranks.share(config.minibatch)
        motions = self._some(pool, share)
        shift = share.of(torch.randint(config.shift + 1, (share.total,), generator=self.generator))
        z = share.whole(self.encoder(cut(motions, torch.full_like(shift, config.shift), config.frames)))
        overlapping = share.whole(self.encoder(cut(motions, config.shift - shift, config.frames)))
        return {
            "alignment": config.alignment_weight * alignment_loss(z, overlapping),
            "uniformity": config.uniformity_weight * uniformity_loss(z),
        }

    def _draw_motions(self, n: int, frames: int | None = None) -> Windows:
        drawn = self.demonstrations(n, self.generator, frames=frames or self.config.encoder.frames)
        return Windows(drawn["window"], mask=drawn.get("mask"))

    @torch.no_grad()
    def _encoded_demonstration(self, pool: Windows, part: Part) -> Windows:
        """A minibatch's part of windows, each out of a motion of the pool, with the motion's encoding."""
        config = self.config
        motions = self._some(pool, part)
        motions = motions._replace(window=motions.window[:, config.encoder.shift :])
        first = torch.randint(config.encoder.frames - config.window + 1, (part.total,), generator=self.generator)
        return cut(motions, part.of(first), config.window)._replace(condition=self.encoder(motions), part=part)

    def _some(self, pool: Windows, part: Part) -> Windows:
        """A part of motions drawn from the pool."""
        return select(pool, part.of(torch.randint(len(pool.window), (part.total,), generator=self.generator)))

    def _negative(self, demonstration: Windows) -> Windows | None:
        """True windows with a latent that is not theirs."""
        if self.config.negatives == "none":
            return None
        z, part = demonstration.condition, demonstration.part
        assert z is not None
        assert part is not None
        if self.config.negatives == "sphere":
            z = sample_sphere(part.total, self.latent_dim, self.generator)
            return demonstration._replace(condition=part.of(z))
        return demonstration._replace(condition=part.of(part.whole(z).roll(1, 0)))  # the rows are drawn independently

    @torch.no_grad()
    def _mismatched_score(self, agent: Windows) -> Tensor:
        """The discriminator's mean score of the agent's windows under latents that they did not follow."""
        assert agent.condition is not None
        assert agent.part is not None
        other = agent.part.of(agent.part.whole(agent.condition).roll(1, 0))
        logits = self.discriminator.logits(agent.window, other, agent.mask)
        return agent.weight * self.discriminator.score(logits).mean()

    def _observe_demonstrations(self) -> None:
        """The discriminator's and the encoder's normalisers see the clips."""
        drawn = self.demonstrations(self.config.discriminator.minibatch, self.generator)
        mask = drawn.get("mask")
        self.discriminator.observe(drawn["window"], mask)
        self.encoder.normalizer.update(drawn["window"], None if mask is None else mask[:, None])

    def state_dict(self) -> dict[str, Any]:
        return {**state_of(self._parts), **self._merged_state()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        load_parts(self._parts, state)
