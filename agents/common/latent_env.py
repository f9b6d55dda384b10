"""An environment seen from above: an action is a latent, which a frozen low-level agent follows for some steps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space
from torch import Tensor

from murmillo.agents.common.decoder import Command, Decoder, SphereDecoder
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Agent, Obs, Steerable
from murmillo.agents.common.rollout import Rollout, taken, tensors, true_next_obs

Results = tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]
"""What `step` gives: observations, reward `[N]`, terminated `[N]`, truncated `[N]`, infos."""

LatentTerms = Callable[[Tensor, Obs], Mapping[str, Tensor]]
"""Reward terms `[N]` by name for latents `[N, Z]` that were chosen on seeing the observations."""


class LowLevelAgent(Agent, Steerable, Protocol):
    """A trained agent that acts under latents and judges the motion that comes of it."""

    generator: torch.Generator
    """Of what it draws while it acts and judges: masks of its windows."""


@dataclass
class LatentEnvConfig:
    """
    Attributes:
        steps: K, how many steps of the environment a latent is followed for; 5 make 6 Hz of 30 (ASE, appendix A).
        terms: which of the low-level agent's own reward terms are side rewards. "style" is its discriminator's, a
            motion prior that ASE weighs 0.1 beside the task's 0.9 (section 7.2, table 3); CALM does without.
    """

    steps: int = 5
    terms: tuple[str, ...] = ("style",)

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise AgentError(f"latent_env.steps={self.steps}: needs at least 1; the papers have 5")


class LatentEnv(VectorWrapper):
    """A vector environment in which one step is a decision: K steps under the mean actions of a low-level policy.

    Observations are the environment's own. The low-level agent, its normalisers too, stays as it is: nothing here calls
    its `update`.

    The reward is the mean of the task's over the K steps. `infos["side_rewards"]` has the means of all else by name, so
    that a runner weighs and logs one by one: the low-level agent's terms, those of the latent itself, and the
    environment's own side rewards. `infos["reward_terms"]` are the means of the task's terms.

    An episode that ends within a decision ends the decision: `terminated`, `truncated` and `final_obs` are those of its
    last step, and the steps after that count as 0 in the means. (So the decisions of an episode sum up to its return
    over K, however they fall.) The environment goes on meanwhile, as the other worlds must, and the new episode lives
    its first steps, at most K - 1, under the old latent. They are nobody's decision: what they bring counts nowhere,
    not even where it is another end.
    """

    env: Any

    def __init__(
        self,
        env: VectorEnv,
        low: LowLevelAgent,
        config: LatentEnvConfig | None = None,
        *,
        decoder: Decoder | None = None,
        latent_terms: LatentTerms | None = None,
        on_step: Sequence[Callable[[Tensor, Results], None]] = (),
    ) -> None:
        """
        Args:
            env: in SAME_STEP autoreset mode, with dict observations, `state_dict` and `load_state_dict`.
            low: made for as many worlds.
            config: how long a decision is, and how it is judged.
            decoder: what an action means; by default it is a latent before its projection onto the sphere.
            latent_terms: side rewards of the choice itself.
            on_step: called after every step of `env` with the actions `[N, A]` and what they gave, for films and
                recordings.

        Raises:
            AgentError: the environment's autoreset mode is another, or it has no state to resume from.
        """
        super().__init__(env)
        mode = env.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise AgentError(f"the environment's autoreset_mode is {mode}; a LatentEnv needs AutoresetMode.SAME_STEP")
        if not hasattr(env, "state_dict"):
            raise AgentError(f"{env} has no state_dict to resume from; a LatentEnv needs it, and load_state_dict")
        self.low = low
        self.config = config or LatentEnvConfig()
        self.decoder = decoder or SphereDecoder(low.latent_dim)
        self.latent_terms = latent_terms
        self.on_step = on_step
        self.single_action_space = self.decoder.space
        self.action_space = batch_space(self.decoder.space, env.num_envs)
        self._row = Rollout(1, env.num_envs)
        self._obs: Obs = {}

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        obs, infos = self.env.reset(seed=seed, options=options)
        self._obs = tensors(obs)
        return obs, infos

    def observation(self) -> dict[str, np.ndarray]:
        """The observation as it is now; after a command to `env`, such as `set_skill`, it must be asked for."""
        obs = self.env.observation()
        self._obs = tensors(obs)
        return obs

    def step(self, actions: np.ndarray | Tensor) -> Results:
        """One decision in every world, of actions `[N, A]`. See the class for what comes back."""
        command = self.decoder(torch.as_tensor(actions))
        chosen = self.latent_terms(command.latent, self._obs) if self.latent_terms else {}
        self.low.follow(command.latent)
        decision = _Decision(self.num_envs)
        for _ in range(self.config.steps):
            results, judged = self._low_step(command)
            decision.add(results, {**judged, **chosen})
        obs, *_ = results
        outcome = decision.outcome(self.config.steps)
        reward, terminated, truncated, infos = outcome if self.tensors else _arrays(outcome)
        return obs, reward, terminated, truncated, infos

    @property
    def tensors(self) -> bool:
        """Whether it shows tensors, as the environment does."""
        return getattr(self.env, "tensors", False)

    def _low_step(self, command: Command) -> tuple[Results, dict[str, Tensor]]:
        """One step of the environment, and what the low-level agent thinks of it: its terms `[N]` by name."""
        row = self._row
        obs = self._obs | command.observed
        step = self.low.act(obs, deterministic=True)
        row.store(0, {**obs, **step.extras, "action": step.action, "log_prob": step.log_prob})
        results = self.env.step(taken(self.env, step.action))
        next_obs, *_, infos = results
        row.store(0, {f"next_{name}": value for name, value in true_next_obs(next_obs, infos).items()})
        self._obs = tensors(next_obs)
        for call in self.on_step:
            call(step.action, results)
        return results, self._judge()

    def _judge(self) -> dict[str, Tensor]:
        asked = self.config.terms
        terms = self.low.rewards(self._row) if asked else {}
        if not terms.keys() >= set(asked):
            raise AgentError(f"latent_env.terms names {', '.join(asked)}; the low-level agent has {', '.join(terms)}")
        return {name: terms[name][0] for name in asked}

    def state_dict(self) -> dict[str, Any]:
        """All that the next decision depends on, but for the low-level agent's networks."""
        return {"env": self.env.state_dict(), "obs": self._obs, "generator": self.low.generator.get_state()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`, bit for bit."""
        self.env.load_state_dict(state["env"])
        self._obs = state["obs"]
        self.low.generator.set_state(state["generator"].cpu())


class _Decision:
    """Sums up the steps of a decision, in every world until its episode ends."""

    def __init__(self, num_envs: int) -> None:
        self._going = torch.ones(num_envs, dtype=torch.bool)
        self._terminated = self._truncated = self._healed = ~self._going
        self._sums: dict[str, dict[str, Tensor]] = {}
        self._final: Obs = {}

    def add(self, results: Results, side_rewards: Mapping[str, Tensor]) -> None:
        """One step: what the environment gave, and further side rewards `[N]` of it."""
        obs, reward, terminated, truncated, infos = results
        self._sum("task", {"reward": reward})
        self._sum("side_rewards", {**infos.get("side_rewards", {}), **side_rewards})
        self._sum("reward_terms", infos.get("reward_terms", {}))
        for name, value in true_next_obs(obs, infos).items():
            going = self._going.view(-1, *[1] * (value.ndim - 1))
            self._final[name] = torch.where(going, value, self._final.get(name, value))
        self._terminated = self._terminated | self._going & torch.as_tensor(terminated)
        self._truncated = self._truncated | self._going & torch.as_tensor(truncated)
        if "healed" in infos:
            self._healed = self._healed | self._going & torch.as_tensor(infos["healed"])
        self._going = ~(self._terminated | self._truncated)

    def _sum(self, group: str, terms: Mapping[str, Any]) -> None:
        sums = self._sums.setdefault(group, {})
        for name, term in terms.items():
            sums[name] = sums.get(name, 0.0) + torch.where(self._going, torch.as_tensor(term), 0.0)

    def outcome(self, steps: int) -> tuple[Tensor, Tensor, Tensor, dict[str, Any]]:
        """Reward, terminated, truncated and infos of the decision, which has taken so many steps."""
        means = {group: {name: total / steps for name, total in sums.items()} for group, sums in self._sums.items()}
        reward = means.pop("task")["reward"]
        infos = {**means, "final_obs": self._final, "_final_obs": ~self._going, "healed": self._healed}
        return reward, self._terminated, self._truncated, infos


def _arrays(result: Any) -> Any:
    """Arrays in place of the tensors in tuples and dicts."""
    if isinstance(result, Tensor):
        return result.cpu().numpy()
    if isinstance(result, tuple):
        return tuple(_arrays(part) for part in result)
    return {name: _arrays(part) for name, part in result.items()}
