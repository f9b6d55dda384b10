"""C·ASE: conditional adversarial skill embeddings (Dou et al. 2023). A policy that does as its label says."""

from typing import Any

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.case.config import CASEConfig
from murmillo.agents.case.focal import FocalSampling
from murmillo.agents.case.networks import Encoder, LabelEmbedding, SkillHeads
from murmillo.agents.common.assistance import Assistance
from murmillo.agents.common.base import EYE, Base, take_over
from murmillo.agents.common.blending import Blending
from murmillo.agents.common.dimensions import dimensions, skill_count
from murmillo.agents.common.discriminator import Discriminator, Windows
from murmillo.agents.common.discriminator_loss import discriminator_loss
from murmillo.agents.common.interface import Demonstrations, Obs, Step
from murmillo.agents.common.latents import LatentSequence, sample_sphere
from murmillo.agents.common.masks import FeatureMasks
from murmillo.agents.common.networks import REACH, Told, by_name
from murmillo.agents.common.ppo import PPO, Minibatch, action_noise
from murmillo.agents.common.ranks import ALONE, Part, Ranks
from murmillo.agents.common.replay import Replay
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.skill_discovery import diversity_loss, encoder_loss, skill_reward
from murmillo.agents.common.skill_model import SkillModel
from murmillo.agents.common.training import Means, adam, load_module, load_parts, minimise, named, state_of


class CASE(Blending):
    """A policy pi(a | s, z, c) that behaves like the demonstrations of skill c, and differently for every latent z.

    The label c is the environment's observation "skill": who sets it commands the character, at any step. While
    training it is drawn at the beginning of an episode, independently of the state (condition randomisation, appendix
    A.4.2). Skeletal residual forces, where the environment has them, are a part of the action like any other.

    With a base it adapts that, and the labels go on meaning what they meant (`SkillModel`).
    """

    model: SkillModel

    def __init__(
        self,
        env: VectorEnv,
        demonstrations: Demonstrations,
        config: CASEConfig,
        generator: torch.Generator,
        base: Base | None = None,
        *,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            env: read for its spaces and number of worlds only.
            demonstrations: windows of the reference motions, by label.
            config: hyperparameters.
            generator: draws weights, latents, noise and minibatches.
            base: the policy to adapt, with what gives its latents their meaning; None to train one from nothing.
            ranks: who train it together, each with an `env` of as many worlds.

        Raises:
            AgentError: environment or demonstrations give no windows of `config.window` frames, or no labels,
                or the base is another agent's or of other sizes.
        """
        state_dim, action_dim = dimensions(env, demonstrations, config.window)
        labels = skill_count(env)
        self.config = config
        self.base = base is not None
        """Whether a base is adapted."""
        self.latent_dim = config.latent_dim
        self.demonstrations = demonstrations
        self.generator = generator
        self.ranks = ranks
        self.latents = LatentSequence(env.num_envs, config.latent_dim, generator, *config.latent_steps, ranks=ranks)
        self.label = LabelEmbedding(labels, config.label_dim, generator)
        told_dim = config.latent_dim + config.label_dim
        self.model = SkillModel(env, state_dim, action_dim, told_dim, config, generator, base)
        self.needs = self.model.needs
        self.ppo = PPO(self.model, config.ppo, self.label.parameters())
        self.noise = action_noise(config.ppo, generator, ranks)
        heads = SkillHeads(labels)
        self.discriminator = Discriminator(
            config.window, state_dim, config.discriminator, generator, heads, ranks=ranks
        )
        self.encoder = Encoder(
            config.window * state_dim, config.encoder_hidden, config.latent_dim, labels, config.label_dim, generator
        )
        self.assistance = Assistance(labels, env, config.assistance, fades=base is None)
        self.eye = self.discriminator
        if base is not None:
            self.eye = Discriminator(config.window, state_dim, config.discriminator, generator, heads)
            take_over(self.eye, base, "discriminator")  # for the encoder, which sees windows in its units
            take_over(self.encoder, base, "encoder")
            take_over(self.label, base, "label")
            take_over(self.assistance, base, "assistance")
        self.optimizer = adam(
            ([*self.discriminator.parameters(), *self.encoder.parameters()], config.discriminator.learning_rate)
        )
        self.replay = Replay(config.discriminator.replay_size, config.discriminator.replay_keep, ranks)
        self.focal = FocalSampling(labels, config)
        self.masks = FeatureMasks(demonstrations, labels)
        self.iterations = 0
        self._parts = {
            "ppo": self.ppo,
            "noise": self.noise,
            "discriminator": self.discriminator,
            "encoder": self.encoder,
            "optimizer": self.optimizer,
            "replay": self.replay,
            "latents": self.latents,
            "focal": self.focal,
            "assistance": self.assistance,
            **({EYE: self.eye} if self.base else {}),
        }
        # known before the first update, lest that judges windows in raw units and every later one in other units
        self._observe(self._draw_demonstrations())

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        """One step under the labels that are commanded now and the sequence of latents."""
        latent, label = self.latents.step(), obs["skill"]
        told = self._helped(self.model.told(self.condition(latent, label), obs), label)
        action, log_prob = self.model.act(obs["state"], told, None if deterministic else self.noise)
        return Step(action, log_prob, {"latent": latent, "label": label}, self.noise.quiet)

    def condition(self, latent: Tensor, label: Tensor) -> Tensor:
        """What policy and critic are told beside the state: `[..., Z + label_dim]` from `[..., Z]` and `[...]`."""
        return torch.cat([latent, self.label(label)], -1)

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        return self.model.value(obs["state"], self.model.told(self.condition(extras["latent"], extras["label"]), obs))

    def reset(self, env_ids: Tensor) -> None:
        self.latents.reset(env_ids)

    def directions(self) -> dict[str, Any]:
        """Focal sampling draws the labels of new episodes; the curriculum (appendix A.5) begins without the ground."""
        directions: dict[str, Any] = {}
        if self.config.focal != "none" or self.config.focal_steps:
            directions["skill_weights"] = self.focal.commanded
        if self.config.upright_iterations:
            directions["ground_contact"] = self.iterations >= self.config.upright_iterations
        return directions

    @torch.no_grad()
    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """r = -log(1 - D(s, s', c)) + beta log q(z | s, s', c) (section 3.1), as two terms `[T, N]`."""
        config, style, skill = self.config, [], []
        worlds = rollout.ranks.worlds(rollout.num_envs)
        fields = ("next_window", "label", "latent")
        for window, label, latent in zip(*(rollout[name] for name in fields), strict=True):
            mask = self._masks_for(label, worlds)
            x = self.discriminator.prepare(window, mask)
            style.append(self.discriminator.reward(self.discriminator.judge(self.discriminator.features(x), label)))
            if self.base:
                x = self.eye.prepare(window, mask)
            skill.append(skill_reward(self.encoder(x, label), latent, config.kappa, config.skill_reward))
        terms = {"style": torch.stack(style)}
        return terms | {"skill": torch.stack(skill)} if config.skill_discovery else terms

    def update(self, rollout: Rollout) -> dict[str, float]:
        """Learn D by eq. 1 and q by eq. 2, pi and V by eq. 3, and what to practise by eq. 4."""
        self._check_learning()
        config, generator, means = self.config, self.generator, Means()
        windows, labels, latents = (rollout.flat(name) for name in ("next_window", "label", "latent"))
        k = config.discriminator.minibatch

        for update in range(config.discriminator.updates):
            rows, part = rollout.draw(k, generator)
            agent = replay = self._agent_windows(windows.index_select(0, rows), labels[rows], part)
            if len(self.replay):
                remembered, old = self.replay.sample(k, generator)
                replay = self._agent_windows(remembered["window"], remembered["label"], old)
            demonstration = self._draw_demonstrations(part)
            loss = discriminator_loss(
                self.discriminator, agent, replay, demonstration, generator=generator, update=update
            )
            losses = dict(loss.parts)
            if config.skill_discovery and not self.base:
                mu_q = self.encoder(loss.agent_inputs, labels[rows])
                losses["encoder"] = part.weight * encoder_loss(mu_q, latents[rows], config.kappa)
            minimise(self.optimizer, losses, ranks=rollout.ranks)
            means.add({**losses, **loss.scores})

        ppo = self.ppo.update(
            rollout,
            generator,
            fields=("latent", "label", *self.model.seen),
            condition=self._tell,
            extra_loss=lambda batch, mean: self._diversity(batch, mean) | self.model.penalties(batch),
        )
        demonstrations = self._draw_demonstrations()
        heads = self._practise(rollout, demonstrations)
        assistance = self.assistance.update(rollout, self.iterations)
        self.iterations += 1
        self.replay.add({"window": windows, "label": labels}, generator, rollout.part)
        self.discriminator.normalizer.update(rollout["next_state"], ranks=rollout.ranks)
        self._observe(demonstrations)
        return (
            named("discriminator", means.result(rollout.ranks))
            | named("heads", heads)
            | named("focal", self.focal.scalars())
            | named("assistance", assistance)
            | named("ppo", ppo)
        )

    def draw_latents(self, n: int) -> Tensor:
        """Points of the sphere `[n, Z]`, drawn uniformly."""
        return sample_sphere(n, self.latent_dim, self.generator)

    def follow(self, latent: Tensor) -> None:
        self.latents.hold(latent)

    def draw_condition(self, label: Tensor) -> Tensor:
        """Random latents under these labels `[n]`, `[n, Z + label_dim]`, for a policy that is fitted to clips."""
        return self.condition(self.draw_latents(len(label)), label).detach()

    def skill_tables(self) -> dict[str, Tensor]:
        """Share of each skill in the practice, the discriminator's mean score of it, what it has left of forces."""
        tables = {"share": self.focal.probability, "score": self.focal.score}
        return tables | {"forces": self.assistance.share} if self.assistance.helps else tables

    @torch.no_grad()
    def head_scores(self, rollout: Rollout) -> dict[str, Tensor]:
        """Scores `[T, N]` that the commanded skill's head gives, "right", and the mean of all "other" heads."""
        steps, worlds = (
            zip(rollout["next_window"], rollout["label"], strict=True),
            rollout.ranks.worlds(rollout.num_envs),
        )
        scores = [self._heads(self._agent_windows(window, label, worlds)) for window, label in steps]
        return {name: torch.stack([score[name] for score in scores]) for name in scores[0]}

    @torch.no_grad()
    def _practise(self, rollout: Rollout, demonstrations: Windows) -> dict[str, float]:
        """Focal sampling by the scores of this rollout; how far the heads of the discriminator hold the skills apart.

        Returns:
            means of the scores that the right heads and the others give to the agent and to demonstrations.
        """
        agent = self.head_scores(rollout)
        started = self.iterations >= self.config.focal_start
        labels = rollout["label"].flatten()
        self.focal.update(agent["right"].flatten(), labels, active=started, ranks=rollout.ranks)
        scores = {"agent": agent, "demonstration": self._heads(demonstrations)}
        means = {f"{who}_{head}": s.mean().item() for who, heads in scores.items() for head, s in heads.items()}
        return rollout.ranks.mean_scalars(means)

    def _heads(self, windows: Windows) -> dict[str, Tensor]:
        """Scores `[B]` that the head of each window's label gives, and the mean of all other heads, if any."""
        x = self.discriminator.prepare(windows.window, windows.mask)
        score = self.discriminator.score(self.discriminator.head(self.discriminator.features(x)))
        right = self.discriminator.condition.pick(score, windows.condition)
        others = score.shape[1] - 1
        return {"right": right} | ({"other": (score.sum(1) - right) / others} if others else {})

    def _agent_windows(self, window: Tensor, label: Tensor, part: Part | None = None) -> Windows:
        return Windows(window, label, self._masks_for(label, part), part)

    def _masks_for(self, label: Tensor, part: Part | None) -> Tensor | None:
        """What the demonstrations of the same skills leave out is left out too (adaptive masking, appendix A.5)."""
        return self.masks.draw(len(label), self.generator, label, part=part)

    def _draw_demonstrations(self, part: Part | None = None) -> Windows:
        """A minibatch of them, or a part of it."""
        part = part or Part(ALONE, self.config.discriminator.minibatch)
        skill = self.focal.draw(part.total, self.generator)
        drawn = part.drawn(self.demonstrations, self.generator, skill=skill)
        return Windows(drawn["window"], drawn["skill"], drawn.get("mask"), part)

    def _tell(self, batch: Minibatch) -> Told:
        """What policy and critic were told of a minibatch."""
        condition = self.condition(batch["latent"], batch["label"])
        return self._helped(self.model.tell(condition, batch), batch["label"])

    def _helped(self, told: Told, label: Tensor) -> Told:
        """The same, and how far the forces from outside reach under these labels `[...]`."""
        reach = self.assistance.reach(label)
        return told if reach is None else {**by_name(told), REACH: reach}

    def _observe(self, demonstrations: Windows) -> None:
        self.discriminator.observe(demonstrations.window, demonstrations.mask)

    def _diversity(self, batch: Minibatch, mean: Tensor) -> dict[str, Tensor]:
        """The last term of eq. 3: another z' for each sample's z, under the same label."""
        config = self.config
        if config.diversity == "none":
            return {}
        z = batch.part.of(sample_sphere(batch.part.total, config.latent_dim, self.generator))
        other = self._helped(self.model.told(self.condition(z, batch["label"]), batch), batch["label"])
        other_mean = self.model.policy(batch["state"], other)
        std = self.model.policy.moments(mean)[1].detach().exp()
        loss = diversity_loss(mean, other_mean, batch["latent"], z, std, config.diversity)
        return {"diversity": config.diversity_weight * loss}

    def state_dict(self) -> dict[str, Any]:
        return {
            "label": self.label.state_dict(),
            **state_of(self._parts),
            **self._merged_state(),
            "iterations": self.iterations,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        load_module(self.label, state["label"], "label embedding")
        load_parts(self._parts, state)
        self.iterations = state["iterations"]
