"""ASE: adversarial skill embeddings (Peng et al. 2022). `ASE.update` is the paper's Algorithm 1."""

from typing import Any

import torch
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.ase.encoder import Encoder
from murmillo.agents.ase.losses import diversity_loss, encoder_loss, skill_reward
from murmillo.agents.common.discriminator import Discriminator, Windows, discriminator_loss, style_reward
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Demonstrations, Obs, Step
from murmillo.agents.common.latents import LatentSequence, sample_sphere
from murmillo.agents.common.ppo import PPO, ActorCritic, Minibatch
from murmillo.agents.common.replay import Replay
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.training import Means, adam, adam_state, load_adam_state, load_module, named


class ASE:
    """A policy pi(a | s, z) that behaves like the demonstrations, and differently for every latent z on the sphere."""

    needs = frozenset({"state", "next_state", "next_window"})

    def __init__(
        self, env: VectorEnv, demonstrations: Demonstrations, config: ASEConfig, generator: torch.Generator
    ) -> None:
        """
        Args:
            env: read for its spaces and number of worlds only.
            demonstrations: windows of the reference motions.
            config: hyperparameters.
            generator: draws weights, latents, noise and minibatches.

        Raises:
            AgentError: environment or demonstrations give no windows of `config.window` frames.
        """
        state_dim, action_dim = _dimensions(env, demonstrations, config)
        self.config = config
        self.demonstrations = demonstrations
        self.generator = generator
        self.latents = LatentSequence(env.num_envs, config.latent_dim, generator, *config.latent_steps)
        self.model = ActorCritic(state_dim, action_dim, config.latent_dim, config.ppo, generator)
        self.ppo = PPO(self.model, config.ppo)
        hidden = config.discriminator.hidden
        self.discriminator = Discriminator(config.window, state_dim, config.discriminator, generator)
        # known before the first update, lest that judges windows in raw units and every later one in other units
        self.discriminator.normalizer.update(demonstrations(config.discriminator.minibatch, generator)["window"])
        self.encoder = Encoder(config.window * state_dim, hidden, config.latent_dim, config.shared_trunk, generator)
        self.optimizer = adam(
            ([*self.discriminator.parameters(), *self.encoder.parameters()], config.discriminator.learning_rate)
        )
        self.replay = Replay(config.discriminator.replay_size, config.discriminator.replay_keep)

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        """Lines 9-11: one step under the sequence of latents; the mean action if deterministic."""
        latent = self.latents.step()
        action, log_prob = self.model.act(obs["state"], latent, self.generator, deterministic)
        return Step(action, log_prob, {"latent": latent})

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        return self.model.value(obs["state"], extras["latent"])

    def reset(self, env_ids: Tensor) -> None:
        self.latents.reset(env_ids)

    @torch.no_grad()
    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """Line 13: r = -log(1 - D(s, s')) + beta log q(z | s, s'), as two terms `[T, N]`."""
        config = self.config
        style, skill = [], []
        for window, latent in zip(rollout["next_window"], rollout["latent"], strict=True):
            x = self.discriminator.prepare(window)
            features = self.discriminator.features(x)
            style.append(style_reward(self.discriminator.judge(features)))
            skill.append(skill_reward(self.encoder(x, features), latent, config.kappa, config.skill_reward))
        terms = {"style": torch.stack(style)}
        return terms | {"skill": torch.stack(skill)} if config.skill_discovery else terms

    def update(self, rollout: Rollout) -> dict[str, float]:
        """Lines 18-29 of Algorithm 1."""
        config, generator, means = self.config, self.generator, Means()
        windows, latents = rollout.flat("next_window"), rollout.flat("latent")
        k = config.discriminator.minibatch

        # lines 18-28: encoder and discriminator are one network (section 8.2), so that one loop updates both
        for _ in range(config.discriminator.updates):
            rows = torch.randint(len(windows), (k,), generator=generator)
            agent = windows[rows]
            replay = self.replay.sample(k, generator)["window"] if len(self.replay) else agent
            demonstration = self.demonstrations(k, generator)["window"]
            loss = discriminator_loss(self.discriminator, Windows(agent), Windows(replay), Windows(demonstration))
            losses = dict(loss.parts)
            if config.skill_discovery:
                mu_q = self.encoder(loss.agent_inputs, loss.agent_features)
                losses["encoder"] = encoder_loss(mu_q, latents[rows], config.kappa)
            self.optimizer.zero_grad()
            torch.stack(list(losses.values())).sum().backward()
            self.optimizer.step()
            means.add({**losses, **loss.scores})

        # line 29: V and pi
        ppo = self.ppo.update(
            rollout,
            generator,
            fields=("latent",),
            condition=lambda batch: batch["latent"],
            extra_loss=self._diversity,
        )
        self.replay.add({"window": windows}, generator)
        self.discriminator.normalizer.update(rollout["next_state"])
        self.discriminator.normalizer.update(self.demonstrations(k, generator)["window"])
        return named("discriminator", means.result()) | named("ppo", ppo)

    def _diversity(self, batch: Minibatch, mean: Tensor) -> dict[str, Tensor]:
        """The last term of eq. 15, with one z' drawn for each sample's z."""
        config = self.config
        if config.diversity == "none":
            return {}
        z = sample_sphere(len(mean), config.latent_dim, self.generator)
        other_mean = self.model.policy(batch["state"], z)
        std = self.model.policy.log_std.exp()
        loss = diversity_loss(mean, other_mean, batch["latent"], z, std, config.diversity)
        return {"diversity": config.diversity_weight * loss}

    def state_dict(self) -> dict[str, Any]:
        return {
            "ppo": self.ppo.state_dict(),
            "discriminator": self.discriminator.state_dict(),
            "encoder": self.encoder.state_dict(),
            "optimizer": adam_state(self.optimizer),
            "replay": self.replay.state_dict(),
            "latents": self.latents.state_dict(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        self.ppo.load_state_dict(state["ppo"])
        load_module(self.discriminator, state["discriminator"], "discriminator")
        load_module(self.encoder, state["encoder"], "encoder")
        load_adam_state(self.optimizer, state["optimizer"])
        self.replay.load_state_dict(state["replay"])
        self.latents.load_state_dict(state["latents"])


def _dimensions(env: VectorEnv, demonstrations: Demonstrations, config: ASEConfig) -> tuple[int, int]:
    """D and A, after a look at whether the windows have the shape that the config speaks of."""
    observations, actions = env.single_observation_space, env.single_action_space
    if not isinstance(observations, spaces.Dict) or not {"state", "window"} <= observations.keys():
        raise AgentError("ASE needs dict observations with 'state' and 'window'; make the environment with window >= 2")
    if not isinstance(actions, spaces.Box) or len(actions.shape) != 1:
        raise AgentError(f"ASE needs a Box action space [A]; the environment's is {actions}")
    state_dim = spaces.flatdim(observations["state"])
    drawn = demonstrations(1, torch.Generator().manual_seed(0))["window"][0]
    expected = [config.window, state_dim]
    for origin, shape in (("the environment", observations["window"].shape), ("a demonstration", drawn.shape)):
        if list(shape or ()) != expected:
            raise AgentError(f"agent.window={config.window} wants windows {expected}; {origin} has {list(shape or ())}")
    return state_dim, actions.shape[0]
