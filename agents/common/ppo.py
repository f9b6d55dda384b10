"""Proximal policy optimisation (Schulman et al. 2017) of a policy and a critic that may be told a condition."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any

import torch
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.exploration import ActionNoise
from murmillo.agents.common.losses import approx_kl, clip_fraction, ppo_policy_loss, value_loss
from murmillo.agents.common.networks import Critic, GaussianPolicy, Policy, Told
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.ranks import Part, Ranks
from murmillo.agents.common.rollout import Rollout
from murmillo.agents.common.training import Means, adam, adam_state, load_adam_state, load_module, minimise

_KL_BAND, _KL_STEP, _KL_REACH = 1.5, 1.3, 100.0
"""How far a KL may be from where it is led to, the factor of the rate's steps, and its bound either way."""


class Minibatch(dict[str, Tensor]):
    """Rows of a rollout by name, `[B, ...]`; "state" is normalised.

    Attributes:
        part: which rows of the minibatch of all ranks they are.
    """

    def __init__(self, rows: Mapping[str, Tensor], part: Part) -> None:
        super().__init__(rows)
        self.part = part


@dataclass
class PPOConfig:
    """Structure and training of policy and critic. Defaults: ASE's Table 2; where it is silent, its released code.

    Attributes:
        hidden: sizes of the hidden layers of policy and critic.
        style_hidden: hidden sizes of the style network before the policy's condition; empty for none.
        std: the policy's standard deviation; the paper's variance is 0.0025.
        std_learning_rate: Adam's step for its logarithm, one for each action dimension; 0 keeps it. Alone they hardly
            move at the rates of weights. AdaptNet's depends on the state and always learns, as weights.
        std_least: what it does not shrink below, so that something is left to learn from once the character stands.
        noise_correlation: between the noise of one action and the next; the papers' noise is white.
        quiet_share: of the steps, in stretches, in which a world acts without noise, as it is played; the policy learns
            from what comes after (`ActionNoise`).
        mean_init_scale: factor on the initial weights of the policy's last layer.
        policy_learning_rate: Adam's step for the policy.
        policy_momentum: of its gradients from minibatch to minibatch, Adam's first beta; 0.9 are the gradients of half
            an iteration here, 0.97 those of two.
        value_learning_rate: Adam's step for the critic.
        epochs: passes over the rollout.
        minibatch: samples a step.
        clip: bound on the ratio's distance from 1.
        bound_weight: of the loss on means beyond [-1, 1].
        value_weight: of the critic's loss; it matters only where the norm of the gradient is bounded.
        max_grad_norm: bound on the norm of the gradient of policy and critic together; None for none.
        target_kl: end the passes at the first minibatch on which the policy is further than this from the one that
            acted [nat]; None goes on.
        lead_kl: lead the policy's learning rate from `policy_learning_rate` to where the mean KL of an iteration is
            about this [nat]; None keeps it.
        critic_first: iterations at the beginning in which the critic learns alone. On a critic that knows nothing the
            first steps of a policy that has been fitted to something undo it.
        kl_halving: iterations after which both KLs are half of what is asked for here, then a third and so on; 0 keeps
            them. Large steps find balance, small ones keep it.
    """

    hidden: tuple[int, ...] = (1024, 1024, 512)
    style_hidden: tuple[int, ...] = (512, 256)
    std: float = 0.05
    std_learning_rate: float = 0.0
    std_least: float = 0.0
    noise_correlation: float = 0.0
    quiet_share: float = 0.0
    mean_init_scale: float = 1.0
    policy_learning_rate: float = 2e-5
    policy_momentum: float = 0.9
    value_learning_rate: float = 2e-5
    epochs: int = 6
    minibatch: int = 16384
    clip: float = 0.2
    bound_weight: float = 10.0
    value_weight: float = 1.0
    max_grad_norm: float | None = None
    target_kl: float | None = None
    lead_kl: float | None = None
    kl_halving: int = 0
    critic_first: int = 0

    def __post_init__(self) -> None:
        check_at_least(1, self, "agent.ppo", "epochs", "minibatch")
        check_at_least(0, self, "agent.ppo", "policy_learning_rate", "value_learning_rate", "std_learning_rate")
        check_at_least(0, self, "agent.ppo", "mean_init_scale", "bound_weight", "value_weight", "kl_halving")
        check_at_least(0, self, "agent.ppo", "std_least", "critic_first")
        check_above_zero(self, "agent.ppo", "std", "clip", "max_grad_norm", "target_kl", "lead_kl")
        if self.std_least > self.std:
            raise AgentError(f"agent.ppo.std_least={self.std_least}: needs at most std, {self.std}")
        for name in ("noise_correlation", "quiet_share", "policy_momentum"):
            if not 0 <= getattr(self, name) < 1:
                raise AgentError(f"agent.ppo.{name}={getattr(self, name)}: needs at least 0 and less than 1")


class ActorCritic(nn.Module):
    """Policy and critic on normalised states; the critic predicts normalised returns.

    What they are told beside the state is a condition `[..., C]` that reaches the policy through its style network and
    the critic raw, or whatever else networks that are given here can be told.
    """

    def __init__(
        self,
        state_dim: int,
        action_dim: int,
        condition_dim: int,
        config: PPOConfig,
        generator: torch.Generator,
        policy: Policy | None = None,
        *,
        critic: nn.Module | None = None,
        state_normalizer: nn.Module | None = None,
        return_normalizer: nn.Module | None = None,
    ) -> None:
        """`policy`, `critic` and normalisers take the place of those that the config describes."""
        super().__init__()
        self.policy: Policy = policy or gaussian_policy(state_dim, action_dim, condition_dim, config, generator)
        self.critic = critic or Critic(state_dim, condition_dim, config.hidden, generator)
        self.state_normalizer: Any = state_normalizer or RunningNormalizer((state_dim,))
        self.return_normalizer: Any = return_normalizer or RunningNormalizer()

    @torch.no_grad()
    def act(self, state: Tensor, told: Told = None, noise: ActionNoise | None = None) -> tuple[Tensor, Tensor]:
        """Actions `[N, A]` and their log probabilities `[N]` for raw states `[N, D]`; the likeliest without noise."""
        parameters = self.policy(self.state_normalizer(state), told)
        action = self.policy.mode(parameters) if noise is None else self.policy.sample(parameters, noise)
        return action, self.policy.log_prob(action, parameters)

    @torch.no_grad()
    def value(self, state: Tensor, told: Told) -> Tensor:
        """Expected returns `[...]` of raw states `[..., D]`, in the reward's units; `[..., C]` of C objectives."""
        return self.return_normalizer.inverse(self.critic(self.state_normalizer(state), told))

    def targets(self, rollout: Rollout) -> Tensor:
        """What the critic is to predict of each sample `[T N]`: its normalised return."""
        return self.return_normalizer(rollout.flat("return"))

    def observe(self, rollout: Rollout) -> None:
        """Let the normalisers learn from a rollout, once the update that used them is over."""
        self.state_normalizer.update(rollout["state"], ranks=rollout.ranks)
        self.return_normalizer.update(rollout["return"], ranks=rollout.ranks)


def action_noise(config: PPOConfig, generator: torch.Generator, ranks: Ranks) -> ActionNoise:
    """The noise that the config describes."""
    return ActionNoise(generator, config.noise_correlation, ranks, quiet_share=config.quiet_share)


def gaussian_policy(
    state_dim: int, action_dim: int, condition_dim: int, config: PPOConfig, generator: torch.Generator
) -> GaussianPolicy:
    """The policy that the config describes, with the condition behind a style network."""
    return GaussianPolicy(state_dim, action_dim, generator=generator, **gaussian_settings(condition_dim, config))


def gaussian_settings(condition_dim: int, config: PPOConfig) -> dict[str, Any]:
    """What `GaussianPolicy` is to be by the config, but for what it acts on and the draw of its weights."""
    return {
        "hidden": config.hidden,
        "std": config.std,
        "condition_dim": condition_dim,
        "style_hidden": config.style_hidden if condition_dim else (),
        "mean_init_scale": config.mean_init_scale,
        "learn_std": config.std_learning_rate > 0,
    }


class PPO:
    """Updates an `ActorCritic` from a rollout with "advantage" and "return".

    The released codes sum all losses under one Adam. Adam rescales each parameter's gradient by its own size and the
    networks share no parameters, so the weights of that sum fall out; policy and critic have a learning rate each here,
    and the reference's case is when all rates are 2e-5.
    """

    def __init__(
        self, model: ActorCritic, config: PPOConfig, condition_parameters: Iterable[nn.Parameter] = ()
    ) -> None:
        """
        Args:
            model: policy and critic.
            config: hyperparameters.
            condition_parameters: of what makes the condition, if the losses are to train it, at the policy's rate.
        """
        self.model = model
        self.config = config
        std = [parameter for name, parameter in model.policy.named_parameters() if name == "log_std"]
        weights = [parameter for name, parameter in model.policy.named_parameters() if name != "log_std"]
        self.optimizer = adam(
            ([*weights, *condition_parameters], config.policy_learning_rate),
            (model.critic.parameters(), config.value_learning_rate),
            (std, config.std_learning_rate),
        )
        group = self.optimizer.param_groups[0]
        group["betas"] = (config.policy_momentum, group["betas"][1])
        self._log_std = std
        """The policy's own, `[A]` each; none where it depends on the state."""
        self._pace = 1.0
        """Of the policy: its learning rate as a multiple of the config's."""
        self._iterations = 0

    def update(
        self,
        rollout: Rollout,
        generator: torch.Generator,
        *,
        fields: tuple[str, ...] = (),
        condition: Callable[[Minibatch], Told] = lambda batch: None,
        extra_loss: Callable[[Minibatch, Tensor], Mapping[str, Tensor]] = lambda batch, mean: {},
        other_loss: Callable[[], Mapping[str, Tensor]] = dict,
    ) -> dict[str, float]:
        """One iteration's passes over the rollout, then the normalisers.

        Args:
            rollout: with state, action, log_prob, return and the normalised advantage.
            generator: draws the minibatches.
            fields: further fields that the minibatches carry to `condition` and `extra_loss`.
            condition: what policy and critic are told, `[B, ...]`, from a minibatch; gradients flow into it. It may add
                to the minibatch what `extra_loss` is to see.
            extra_loss: further weighted losses of the policy by name, from a minibatch and the policy's parameters
                `[B, P]`, a Gaussian's means; each a mean over the minibatch.
            other_loss: further weighted losses by name, of what is no minibatch and the same on all ranks.

        Returns:
            means of the losses, the KL divergence [nat], the clipped share and the entropy [nat]; the policy's learning
            rate of the next iteration where it is led.

        Raises:
            AgentError: the minibatch is larger than the rollout.
        """
        config = self.config
        if config.minibatch > rollout.all_samples:
            raise AgentError(
                f"ppo.minibatch={config.minibatch} is larger than the {rollout.all_samples} samples of an iteration "
                f"({rollout.horizon} steps of {rollout.num_envs * rollout.ranks.size} worlds)"
            )
        data = {name: rollout.flat(name) for name in ("action", "log_prob", "advantage", *fields)}
        data["state"] = self.model.state_normalizer(rollout.flat("state"))
        data["target"] = self.model.targets(rollout)

        means, alone = Means(), self._iterations < config.critic_first
        calm = 1 + self._iterations / config.kl_halving if config.kl_halving else 1.0
        passes = [rollout.minibatches(config.minibatch, generator) for _ in range(config.epochs)]
        for rows, part in chain.from_iterable(passes):
            batch = Minibatch({name: value.index_select(0, rows) for name, value in data.items()}, part)
            told = condition(batch)
            losses, scores = self._losses(batch, _cut(told) if alone else told, extra_loss, other_loss)
            means.add({**losses, **scores})
            if config.target_kl is not None and rollout.ranks.mean(scores["kl"]) > config.target_kl / calm:
                break
            if alone:
                losses = {"value": losses["value"]}
            minimise(self.optimizer, losses, config.max_grad_norm, ranks=rollout.ranks)
            self._keep_noise()
        self.model.observe(rollout)
        self._iterations += 1
        stats = means.result(rollout.ranks)
        if config.lead_kl is None:
            return stats
        if alone:
            return stats | {"policy_rate": 0.0}
        return stats | {"policy_rate": self._lead(stats["kl"] * calm / config.lead_kl)}

    @torch.no_grad()
    def _keep_noise(self) -> None:
        """Hold a learned standard deviation at its least."""
        if self.config.std_least:
            for log_std in self._log_std:
                log_std.clamp_(min=math.log(self.config.std_least))

    def _lead(self, excess: float) -> float:
        """Slow down after an iteration that went too far, hurry after one that hardly moved; the new rate."""
        if excess > _KL_BAND:
            self._set_pace(max(self._pace / _KL_STEP, 1 / _KL_REACH))
        elif excess < 1 / _KL_BAND:
            self._set_pace(min(self._pace * _KL_STEP, _KL_REACH))
        return self._pace * self.config.policy_learning_rate

    def _set_pace(self, pace: float) -> None:
        self._pace = pace
        self.optimizer.param_groups[0]["lr"] = pace * self.config.policy_learning_rate

    def _losses(
        self,
        batch: Minibatch,
        told: Told,
        extra_loss: Callable[[Minibatch, Tensor], Mapping[str, Tensor]],
        other_loss: Callable[[], Mapping[str, Tensor]],
    ) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        config, policy = self.config, self.model.policy
        parameters = policy(batch["state"], told)
        log_prob = policy.log_prob(batch["action"], parameters)
        weigh = batch.part.weigh
        losses = weigh(
            {
                "policy": ppo_policy_loss(log_prob, batch["log_prob"], batch["advantage"], config.clip),
                "bound": config.bound_weight * policy.bound_loss(parameters),
                **extra_loss(batch, parameters),
            }
        )
        losses |= other_loss()
        losses |= weigh(
            {
                "value": config.value_weight * value_loss(self.model.critic(batch["state"], told), batch["target"]),
            }
        )
        with torch.no_grad():
            scores = {
                "kl": approx_kl(log_prob, batch["log_prob"]),
                "clipped": clip_fraction(log_prob, batch["log_prob"], config.clip),
                "entropy": policy.entropy(parameters).mean(),
            }
        return losses, weigh(scores)

    def state_dict(self) -> dict[str, Any]:
        return {
            "model": self.model.state_dict(),
            "optimizer": adam_state(self.optimizer),
            "pace": self._pace,
            "iterations": self._iterations,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        load_module(self.model, state["model"], "policy and critic")
        load_adam_state(self.optimizer, state["optimizer"])
        self._iterations = state["iterations"]
        if self.config.lead_kl is not None:
            self._set_pace(state["pace"])


def _cut(told: Told) -> Told:
    """What is told, with no way back to what made it."""
    if told is None or isinstance(told, Tensor):
        return told if told is None else told.detach()
    return {name: part.detach() for name, part in told.items()}
