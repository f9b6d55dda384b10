"""ASE: adversarial skill embeddings (Peng et al. 2022). `ASE.update` is the paper's Algorithm 1."""

from typing import Any

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.ase.encoder import Encoder
from murmillo.agents.common.base import EYE, Base, take_over
from murmillo.agents.common.blending import Blending
from murmillo.agents.common.dimensions import dimensions
from murmillo.agents.common.discriminator import Discriminator, Windows
from murmillo.agents.common.discriminator_loss import discriminator_loss
from murmillo.agents.common.interface import Demonstrations, Obs, Step
from murmillo.agents.common.latents import LatentSequence, sample_sphere
from murmillo.agents.common.masks import FeatureMasks
from murmillo.agents.common.ppo import PPO, Minibatch, action_noise
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.replay import Replay
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.skill_discovery import diversity_loss, encoder_loss, skill_reward
from murmillo.agents.common.skill_model import SkillModel
from murmillo.agents.common.training import Means, adam, load_parts, minimise, named, state_of


class ASE(Blending):
    """A policy pi(a | s, z) that behaves like the demonstrations, and differently for every latent z on the sphere.

    With a base it adapts that: what each latent is for is still said by the base's encoder (`SkillModel`).
    """

    model: SkillModel

    def __init__(
        self,
        env: VectorEnv,
        demonstrations: Demonstrations,
        config: ASEConfig,
        generator: torch.Generator,
        base: Base | None = None,
        *,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            env: read for its spaces and number of worlds only.
            demonstrations: windows of the reference motions.
            config: hyperparameters.
            generator: draws weights, latents, noise and minibatches.
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
        self.latents = LatentSequence(env.num_envs, config.latent_dim, generator, *config.latent_steps, ranks=ranks)
        self.model = SkillModel(env, state_dim, action_dim, config.latent_dim, config, generator, base)
        self.needs = self.model.needs
        self.ppo = PPO(self.model, config.ppo)
        self.noise = action_noise(config.ppo, generator, ranks)
        hidden = config.discriminator.hidden
        self.discriminator = Discriminator(config.window, state_dim, config.discriminator, generator, ranks=ranks)
        # known before the first update, lest that judges windows in raw units and every later one in other units
        self._observe_demonstrations()
        self.masks = FeatureMasks(demonstrations)
        self.encoder = Encoder(config.window * state_dim, hidden, config.latent_dim, config.shared_trunk, generator)
        self.eye = self.discriminator
        if base is not None:  # the encoder is a head of the base's discriminator, or at least sees windows in its units
            self.eye = Discriminator(config.window, state_dim, config.discriminator, generator)
            take_over(self.eye, base, "discriminator")
            take_over(self.encoder, base, "encoder")
        self.optimizer = adam(
            ([*self.discriminator.parameters(), *self.encoder.parameters()], config.discriminator.learning_rate)
        )
        self.replay = Replay(config.discriminator.replay_size, config.discriminator.replay_keep, ranks)
        self._parts = {
            "ppo": self.ppo,
            "noise": self.noise,
            "discriminator": self.discriminator,
            "encoder": self.encoder,
            "optimizer": self.optimizer,
            "replay": self.replay,
            "latents": self.latents,
            **({EYE: self.eye} if self.base else {}),
        }

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        """Lines 9-11: one step under the sequence of latents; the mean action if deterministic."""
        latent = self.latents.step()
        told = self.model.told(latent, obs)
        action, log_prob = self.model.act(obs["state"], told, None if deterministic else self.noise)
        return Step(action, log_prob, {"latent": latent}, self.noise.quiet)

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        return self.model.value(obs["state"], self.model.told(extras["latent"], obs))

    def reset(self, env_ids: Tensor) -> None:
        self.latents.reset(env_ids)

    @torch.no_grad()
    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """Line 13: r = -log(1 - D(s, s')) + beta log q(z | s, s'), as two terms `[T, N]`."""
        config, worlds = self.config, rollout.ranks.worlds(rollout.num_envs)
        style, skill = [], []
        for window, latent in zip(rollout["next_window"], rollout["latent"], strict=True):
            mask = self.masks.draw(len(window), self.generator, part=worlds)
            x = self.discriminator.prepare(window, mask)
            features = self.discriminator.features(x)
            style.append(self.discriminator.reward(self.discriminator.judge(features)))
            if self.base:
                x = self.eye.prepare(window, mask)
                features = self.eye.features(x)
            skill.append(skill_reward(self.encoder(x, features), latent, config.kappa, config.skill_reward))
        terms = {"style": torch.stack(style)}
        return terms | {"skill": torch.stack(skill)} if config.skill_discovery else terms

    def update(self, rollout: Rollout) -> dict[str, float]:
        """Lines 18-29 of Algorithm 1."""
        self._check_learning()
        config, generator, means = self.config, self.generator, Means()
        windows, latents = rollout.flat("next_window"), rollout.flat("latent")
        k = config.discriminator.minibatch

        # lines 18-28: encoder and discriminator are one network (section 8.2), so that one loop updates both
        for update in range(config.discriminator.updates):
            rows, part = rollout.draw(k, generator)
            agent = windows.index_select(0, rows)
            replay, old = self.replay.sample(k, generator) if len(self.replay) else ({"window": agent}, part)
            drawn = part.drawn(self.demonstrations, generator)
            loss = discriminator_loss(
                self.discriminator,
                agent=Windows(agent, mask=self.masks.draw(k, generator, part=part), part=part),
                replay=Windows(replay["window"], mask=self.masks.draw(k, generator, part=old), part=old),
                demonstration=Windows(drawn["window"], mask=drawn.get("mask"), part=part),
                generator=generator,
                update=update,
            )
            losses = dict(loss.parts)
            if config.skill_discovery and not self.base:
                mu_q = self.encoder(loss.agent_inputs, loss.agent_features)
                losses["encoder"] = part.weight * encoder_loss(mu_q, latents[rows], config.kappa)
            minimise(self.optimizer, losses, ranks=rollout.ranks)
            means.add({**losses, **loss.scores})

        # line 29: V and pi
        ppo = self.ppo.update(
            rollout,
            generator,
            fields=("latent", *self.model.seen),
            condition=lambda batch: self.model.tell(batch["latent"], batch),
            extra_loss=lambda batch, mean: self._diversity(batch, mean) | self.model.penalties(batch),
        )
        self.replay.add({"window": windows}, generator, rollout.part)
        self.discriminator.normalizer.update(rollout["next_state"], ranks=rollout.ranks)
        self._observe_demonstrations()
        return named("discriminator", means.result(rollout.ranks)) | named("ppo", ppo)

    def draw_latents(self, n: int) -> Tensor:
        """Points of the sphere `[n, Z]`, drawn uniformly."""
        return sample_sphere(n, self.latent_dim, self.generator)

    def follow(self, latent: Tensor) -> None:
        self.latents.hold(latent)

    def draw_condition(self, label: Tensor) -> Tensor:
        """Random latents `[n, Z]` whatever the labels `[n]`, for a policy that is fitted to clips."""
        return self.draw_latents(len(label))

    def _observe_demonstrations(self) -> None:
        drawn = self.demonstrations(self.config.discriminator.minibatch, self.generator)
        self.discriminator.observe(drawn["window"], drawn.get("mask"))

    def _diversity(self, batch: Minibatch, mean: Tensor) -> dict[str, Tensor]:
        """The last term of eq. 15, with one z' drawn for each sample's z."""
        config = self.config
        if config.diversity == "none":
            return {}
        z = batch.part.of(sample_sphere(batch.part.total, config.latent_dim, self.generator))
        other_mean = self.model.policy(batch["state"], self.model.told(z, batch))
        std = self.model.policy.moments(mean)[1].detach().exp()
        loss = diversity_loss(mean, other_mean, batch["latent"], z, std, config.diversity)
        return {"diversity": config.diversity_weight * loss}

    def state_dict(self) -> dict[str, Any]:
        return {**state_of(self._parts), **self._merged_state()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        load_parts(self._parts, state)
