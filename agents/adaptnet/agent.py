"""AdaptNet: policies of a goal and a style, and their adaptation to what is new (Xu et al. 2023a and b)."""

from typing import Any

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.adaptnet.config import AdaptNetConfig
from murmillo.agents.adaptnet.ensemble import Ensemble, hinge_loss, imitation_reward
from murmillo.agents.adaptnet.model import HistoryActorCritic, make_model
from murmillo.agents.adaptnet.spaces import Observed
from murmillo.agents.common.adaptation import announce, penalties
from murmillo.agents.common.base import MERGED, Base
from murmillo.agents.common.blending import Blending, another_base
from murmillo.agents.common.discriminator import Windows
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Demonstrations, Obs, Step
from murmillo.agents.common.masks import FeatureMasks
from murmillo.agents.common.networks import Told
from murmillo.agents.common.ppo import PPO, Minibatch, action_noise
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.training import Means, adam, load_parts, minimise, named, state_of


class AdaptNet(Blending):
    """A policy that reaches a goal in the style of the demonstrations; with a base, an adaptation of that.

    Goal and style have critics of their own, and the policy follows the sum of their normalised advantages (eq. 9). An
    adaptation has new critics and discriminators and trains only what is new in the policy (eq. 12, Algorithm 1).
    """

    objectives = ("task", "imitation")
    model: HistoryActorCritic

    def __init__(
        self,
        env: VectorEnv,
        demonstrations: Demonstrations,
        config: AdaptNetConfig,
        generator: torch.Generator,
        base: Base | None = None,
        *,
        ranks: Ranks = ALONE,
    ) -> None:
        """
        Args:
            env: read for its spaces only: "state" `[F, D]` or `[D]`, "window" `[W, D']`, and as far as there are,
                "length" of valid states, "goal" `[G]` and "heights" `[35, 35]`.
            demonstrations: windows of the reference motions.
            config: hyperparameters.
            generator: draws weights, noise and minibatches.
            base: the policy to adapt; None to train one from nothing.
            ranks: who train it together, each with an `env` of as many worlds.

        Raises:
            AgentError: environment, demonstrations, base and config do not fit together.
        """
        self.observed = Observed.of(env, demonstrations, config.window)
        self.needs = self.observed.needs
        self.config = config
        self.demonstrations = demonstrations
        self.generator = generator
        self.ranks = ranks
        self.base = None if base is None else base.digest
        self.model = make_model(self.observed, len(self.objectives), config, generator, base)
        self.ppo = PPO(self.model, config.ppo)
        self.discriminator = Ensemble(config.window, self.observed.frame_dim, config.discriminator, generator)
        # known before the first update, lest that judges windows in raw units and every later one in other units
        self._observe_demonstrations()
        self.masks = FeatureMasks(demonstrations)
        self.optimizer = adam((self.discriminator.parameters(), config.discriminator.learning_rate))
        self.noise = action_noise(config.ppo, generator, ranks)
        self._parts = {
            "ppo": self.ppo,
            "noise": self.noise,
            "discriminator": self.discriminator,
            "optimizer": self.optimizer,
        }

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        told = self.observed.beside(obs)
        state, noise = self.observed.state(obs), None if deterministic else self.noise
        return Step(*self.model.act(state, told, noise), quiet=self.noise.quiet)

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        """Expected returns `[..., 2]` of goal and imitation."""
        return self.model.value(self.observed.state(obs), self.observed.beside(obs))

    def reset(self, env_ids: Tensor) -> None:
        """Nothing lasts from step to step: the history is observed."""

    @torch.no_grad()
    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """Eq. 11 as the term "imitation" `[T, N]`."""
        scores, worlds = [], rollout.ranks.worlds(rollout.num_envs)
        for window in rollout["next_window"]:
            mask = self.masks.draw(len(window), self.generator, part=worlds)
            scores.append(imitation_reward(self.discriminator.logits(window, mask=mask)))
        return {"imitation": torch.stack(scores)}

    def update(self, rollout: Rollout) -> dict[str, float]:
        """The discriminators by eq. 10, policy and critics by eq. 9, or by eq. 12 with a base.

        Raises:
            AgentError: the policy was blended of two or merged, and is for playing only.
        """
        self._check_learning()
        generator, config, means = self.generator, self.config.discriminator, Means()
        windows = rollout.flat("next_window")
        for _ in range(config.epochs):
            for rows, part in rollout.minibatches(config.minibatch, generator):
                drawn = part.drawn(self.demonstrations, generator)
                agent = Windows(
                    windows.index_select(0, rows), mask=self.masks.draw(len(rows), generator, part=part), part=part
                )
                demonstration = Windows(drawn["window"], mask=drawn.get("mask"), part=part)
                loss = hinge_loss(self.discriminator, agent, demonstration, config.gradient_penalty, generator)
                minimise(self.optimizer, loss.parts, ranks=rollout.ranks)
                means.add({**loss.parts, **loss.scores})

        told = self.observed.told
        seen = rollout.alike()
        for name in ("action", "log_prob", "advantage", "return", *told):
            seen[name] = rollout[name]
        seen["state"] = self.observed.state({"state": rollout["state"]})
        ppo = self.ppo.update(seen, generator, fields=told, condition=self._tell, extra_loss=self._regularise)
        self.discriminator.normalizer.update(rollout["next_window"], ranks=rollout.ranks)
        self._observe_demonstrations()
        return named("discriminator", means.result(rollout.ranks)) | named("ppo", ppo)

    def state_dict(self) -> dict[str, Any]:
        return {**state_of(self._parts), **self._merged_state(), "base": self.base}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        if MERGED not in state and "base" in state and state["base"] != self.base:
            raise AgentError(f"{another_base(state['base'], self.base)}; name the base that it was trained on")
        load_parts(self._parts, state)

    def _observe_demonstrations(self) -> None:
        drawn = self.demonstrations(self.config.discriminator.minibatch, self.generator)
        self.discriminator.observe(drawn["window"], drawn.get("mask"))

    def _tell(self, batch: Minibatch) -> Told:
        """What policy and critics are told; of an adapted policy also its injection, which is penalised too."""
        return announce(self.model.policy, batch, self.observed.beside(batch))

    def _regularise(self, batch: Minibatch, parameters: Tensor) -> dict[str, Tensor]:
        """The penalties of eq. 12, and the weight decay of FT + Reg."""
        config, policy = self.config, self.model.policy
        if self.base is not None and config.method == "finetune":
            squares = torch.stack([parameter.square().sum() for parameter in policy.parameters()])
            return {"decay": config.weight_decay * squares.sum()}
        return penalties(policy, batch, config)
