"""The training loop: collect, reward, advantage, update, log, save."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from torch import Tensor

from murmillo.agents.common import checkpoint
from murmillo.agents.common.advantages import gae, normalise_advantage, weigh_advantages
from murmillo.agents.common.episodes import EpisodeStatistics
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.failures import WatchConfig
from murmillo.agents.common.interface import Agent, Directing, MultiObjective
from murmillo.agents.common.logger import Logger
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.rollout import Rollout, taken, tensors, true_next_obs
from murmillo.agents.common.watch import Watch

_SAVED = ("meta", "agent", "generator", "samples", "iteration", "fallen", "watch")
"""What every checkpoint of a run holds; that of its worlds only where the environment has a state."""


_MEMORY = 0.02
"""Of an iteration, in the share of late episodes that ended in a termination."""


@dataclass
class RunnerConfig:
    """How long to train and on what reward. Defaults: ASE's Table 2.

    Attributes:
        samples: end after this many, counted over all resumed runs.
        horizon: T, steps of every world an iteration; 32 with 4,096 worlds makes the paper's 131,072 samples.
        gamma: discount.
        lam: lambda of GAE and of TD(lambda).
        reward_weights: a weight for every reward term that the agent names, and for those of the environment that
            should count: "task", its own reward, and what `infos["side_rewards"]` holds; a weight of 0 may name a term
            that there is not. 1 and beta = 0.5 are ASE's. Of an agent with several objectives they weigh not rewards
            but advantages.
        termination_reward: in place of all rewards at a step that terminates (AdaptNet's code: -25); None leaves them.
        termination_fades: whether that is multiplied by the share of late episodes that did end so: a price that makes
            the character stand keeps it, once it stands, from trying anything else.
        checkpoint_minutes: save this often, and at the end.
        max_minutes: end after this much time, counted from `run`; None for no limit.
        watch: when to warn that the training fails.
    """

    samples: int = 10_000_000_000
    horizon: int = 32
    gamma: float = 0.99
    lam: float = 0.95
    reward_weights: dict[str, float] = field(default_factory=lambda: {"style": 1.0, "skill": 0.5})
    checkpoint_minutes: float = 10.0
    max_minutes: float | None = None
    termination_reward: float | None = None
    termination_fades: bool = False
    watch: WatchConfig = field(default_factory=WatchConfig)

    def __post_init__(self) -> None:
        weights = {f"reward_weights.{term}": weight for term, weight in self.reward_weights.items()}
        for name, value in {**weights, "termination_reward": self.termination_reward}.items():
            if value is not None and not math.isfinite(value):
                raise AgentError(f"runner.{name}={value}: needs a finite number")


class Runner:
    """Trains an agent in a vector environment, exactly resumable: N iterations and N more are 2 N, bit for bit.

    That holds where the environment has `state_dict` and `load_state_dict` and draws its randomness from a state in it;
    without them a resumed run begins with fresh episodes.

    Ranks that share a run have a runner each, with a share of the worlds, and do everything at a time; the first one
    writes. The checkpoint is that of one process with all the worlds, but for what the worlds are in: as many ranks as
    there were go on exactly, another number of them with fresh episodes.

    Nothing is learned from steps in which a world's simulation diverged (`infos["healed"]`).

    Tensors are where the generator is; on a GPU, make the agent and call the runner in `with torch.device(...)`.
    """

    def __init__(
        self,
        env: VectorEnv,
        agent: Agent,
        config: RunnerConfig,
        generator: torch.Generator,
        checkpoint_folder: Path | str,
        *,
        meta: Mapping[str, Any] | None = None,
        logger: Logger | None = None,
        ranks: Ranks = ALONE,
        on_iteration: Sequence[Callable[[dict[str, float]], None]] = (),
        on_warning: Sequence[Callable[[str], None]] = (),
    ) -> None:
        """
        Args:
            env: in SAME_STEP autoreset mode, with dict observations.
            agent: draws from the same `generator`.
            config: how long and on what.
            generator: the run's one source of randomness outside the environment; seeds the environment too.
            checkpoint_folder: where `save` writes.
            meta: JSON values that a checkpoint must share to be loaded: character, dimensions, skills.
            logger: takes every iteration's statistics; the first rank's is enough.
            ranks: who share the run; samples, seed and statistics are those of all.
            on_iteration: called with every iteration's statistics.
            on_warning: called with one line on a known failure, when it has lasted; `watch.notices` keeps them.

        Raises:
            AgentError: the environment's autoreset mode is another.
        """
        mode = env.metadata.get("autoreset_mode")
        if mode is not AutoresetMode.SAME_STEP:
            raise AgentError(f"the environment's autoreset_mode is {mode}; the runner needs AutoresetMode.SAME_STEP")
        self.env = env
        self.agent = agent
        self.config = config
        self.generator = generator
        self.checkpoint_folder = Path(checkpoint_folder)
        self.meta = dict(meta or {})
        self.logger = logger
        self.ranks = ranks
        self.on_iteration = on_iteration
        self.on_warning = on_warning
        self.watch = Watch(config.watch)
        self.samples = 0
        self.iteration = 0
        self.fallen = 1.0
        """Share of the late episodes that ended in a termination."""
        self._rollout = Rollout(config.horizon, env.num_envs, ranks)
        self._episodes = EpisodeStatistics(env.num_envs)
        self._obs: dict[str, Tensor] | None = None
        self._extras: tuple[str, ...] = ()
        self._env_terms: tuple[str, ...] = ("task",)
        self._stopping = False

    def run(self) -> None:
        """Train until the samples or the minutes are used up or `stop` is called; ends with a checkpoint."""
        begun = saved = time.monotonic()
        while not self._finished(begun):
            started = time.monotonic()
            self._direct()
            rollout = self._collect()
            rewards = self._reward(rollout)
            self._advantage(rollout)
            scalars = self.agent.update(rollout)
            self._check(scalars)
            self._log(rewards | scalars, time.monotonic() - started)
            if self.ranks.any(time.monotonic() - saved > 60 * self.config.checkpoint_minutes):
                self.save()
                saved = time.monotonic()
        self.save()

    def stop(self) -> None:
        """End `run` after the iteration under way; safe to call from a signal handler."""
        self._stopping = True

    def _finished(self, begun: float) -> bool:
        minutes = (time.monotonic() - begun) / 60
        limit = math.inf if self.config.max_minutes is None else self.config.max_minutes
        return self.ranks.any(self._stopping or self.samples >= self.config.samples or minutes >= limit)

    def _direct(self) -> None:
        """Tell the environment what the agent wants of the next episodes."""
        directions = self.agent.directions() if isinstance(self.agent, Directing) else {}
        for name, value in directions.items():
            if not hasattr(self.env, f"set_{name}"):
                raise AgentError(f"the agent directs the environment's {name}, but that has no method set_{name}")
            getattr(self.env, f"set_{name}")(value)

    def _collect(self) -> Rollout:
        """T steps of every world."""
        rollout = self._rollout
        obs = self._obs if self._obs is not None else self._first_obs()
        for t in range(self.config.horizon):
            step = self.agent.act(obs)
            seen = {name: value for name, value in obs.items() if name in self.agent.needs}
            rollout.store(t, {**seen, **step.extras, "action": step.action, "log_prob": step.log_prob})
            if step.quiet is not None:
                rollout.store(t, {"quiet": step.quiet})
            next_obs, reward, terminated, truncated, infos = self.env.step(taken(self.env, step.action))

            successor = {f"next_{name}": value for name, value in true_next_obs(next_obs, infos).items()}
            successor = {name: value for name, value in successor.items() if name in self.agent.needs}
            ends = {"terminated": torch.as_tensor(terminated), "truncated": torch.as_tensor(truncated)}
            side = {name: torch.as_tensor(term) for name, term in infos.get("side_rewards", {}).items()}
            rollout.store(t, {**successor, **ends, "task": torch.as_tensor(reward), **side})
            if "healed" in infos:
                rollout.store(t, {"healed": torch.as_tensor(infos["healed"])})
            done = ends["terminated"] | ends["truncated"]
            self._episodes.step(ends["terminated"], done)
            if done.any() or self.ranks.size > 1:
                self.agent.reset(done.nonzero().flatten())
            obs = tensors(next_obs)
            self._extras, self._env_terms = tuple(step.extras), ("task", *side)
        self._obs = obs
        return rollout

    def _first_obs(self) -> dict[str, Tensor]:
        seed = int(torch.randint(2**31, (), generator=self.generator))
        obs, _ = self.env.reset(seed=seed + self.ranks.rank)
        self.agent.reset(torch.arange(self.env.num_envs))
        return tensors(obs)

    def _reward(self, rollout: Rollout) -> dict[str, float]:
        """The terms as "reward", summed by weight or one an objective; the mean of each and of the sum, by name."""
        weights = {**dict.fromkeys(self._env_terms, 0.0), **self.config.reward_weights}
        terms = {**{name: rollout[name] for name in self._env_terms}, **self.agent.rewards(rollout)}
        weights = {name: weight for name, weight in weights.items() if weight or name in terms}
        if terms.keys() != weights.keys():
            raise AgentError(
                f"reward_weights names {', '.join(sorted(self.config.reward_weights))}, "
                f"but the terms are {', '.join(sorted(terms))}"
            )
        total = torch.stack([weights[name] * term for name, term in terms.items()]).sum(0)
        reward = self._by_objective(terms, weights) if isinstance(self.agent, MultiObjective) else total
        if self.config.termination_reward is not None:
            terminated = rollout["terminated"].view(*rollout.shape, *[1] * (reward.dim() - 2))
            fading = self.fallen if self.config.termination_fades else 1.0
            reward = reward.masked_fill(terminated, fading * self.config.termination_reward)
        rollout["reward"] = reward
        means = {f"reward/{name}": term.mean().item() for name, term in terms.items()}
        return self.ranks.mean_scalars(means | {"reward/total": total.mean().item()})

    def _by_objective(self, terms: Mapping[str, Tensor], weights: Mapping[str, float]) -> Tensor:
        """The terms that have a critic, `[T, N, C]`."""
        assert isinstance(self.agent, MultiObjective)
        stray = [name for name, weight in weights.items() if weight and name not in self.agent.objectives]
        if stray:
            raise AgentError(
                f"reward_weights.{stray[0]}={weights[stray[0]]}: the agent has critics for "
                f"{', '.join(self.agent.objectives)} only; weigh it with 0"
            )
        return torch.stack([terms[name] for name in self.agent.objectives], -1)

    def _advantage(self, rollout: Rollout) -> None:
        """Values in one batch, then "advantage", normalised, and "return"."""
        extras = {name: rollout[name] for name in self._extras}
        obs = {name: rollout[name] for name in self.agent.needs if not name.startswith("next_")}
        next_obs = {name[5:]: rollout[name] for name in self.agent.needs if name.startswith("next_")}
        value, next_value = self.agent.value(obs, extras), self.agent.value(next_obs, extras)
        done = rollout["terminated"] | rollout["truncated"]
        if "healed" in rollout:
            self._leave_out(rollout, rollout["healed"], value)
        advantage = gae(
            rollout["reward"], value, next_value, rollout["terminated"], done, self.config.gamma, self.config.lam
        )
        rollout["return"] = advantage + value
        if isinstance(self.agent, MultiObjective):
            weights = [self.config.reward_weights.get(name, 0.0) for name in self.agent.objectives]
            rollout["advantage"] = weigh_advantages(advantage, weights, ranks=self.ranks)
        else:
            rollout["advantage"] = normalise_advantage(advantage, ranks=self.ranks)
        if "quiet" in rollout:
            rollout["advantage"] = rollout["advantage"].masked_fill(rollout["quiet"], 0.0)

    def _leave_out(self, rollout: Rollout, healed: Tensor, value: Tensor) -> None:
        """Learn nothing from steps in which a simulation diverged; the steps before them end in the expected return."""
        rollout.leave_out(healed)
        wide = healed.view(*rollout.shape, *[1] * (value.dim() - 2))
        rollout["reward"] = torch.where(wide, value, rollout["reward"])

    def _check(self, scalars: Mapping[str, float]) -> None:
        for name, value in scalars.items():
            if not math.isfinite(value):
                raise AgentError(
                    f"iteration {self.iteration + 1}: {name} is {value}: the training has diverged; begin anew with a "
                    "lower agent.ppo.policy_learning_rate, agent.ppo.value_learning_rate or "
                    f"agent.discriminator.learning_rate; {self.checkpoint_folder} is from before"
                )

    def _log(self, scalars: dict[str, float], seconds: float) -> None:
        self.samples += self._rollout.all_samples
        self.iteration += 1
        stats = {
            "samples": float(self.samples),
            "iteration": float(self.iteration),
            "samples_per_second": self._rollout.all_samples / seconds,
            **self._episodes.summary(self.ranks),
            **(self._healed() if "healed" in self._rollout else {}),
            **scalars,
        }
        if not math.isnan(rate := stats["episode/fall_rate"]):
            self.fallen += _MEMORY * (rate - self.fallen)
        if self.logger is not None:
            self.logger.log(self.samples, stats)
        for callback in self.on_iteration:
            callback(stats)
        for warning in self.watch.see(stats):
            for callback in self.on_warning:
                callback(warning)

    def _healed(self) -> dict[str, float]:
        """How many steps of all ranks were left out because a world's simulation diverged."""
        return {"episode/healed": float(self.ranks.sum(self._rollout["healed"].sum()))}

    def save(self) -> None:
        """Write all that the next iteration depends on to the checkpoint folder; all ranks must call it."""
        state: dict[str, Any] = {
            "meta": self.meta,
            "agent": self.agent.state_dict(),
            "generator": self.generator.get_state(),
            "samples": self.samples,
            "iteration": self.iteration,
            "fallen": self.fallen,
            "watch": self.watch.state_dict(),
        }
        if self._obs is not None and hasattr(self.env, "state_dict"):
            worlds = {"env": self.env.state_dict(), "obs": self._obs, "episodes": self._episodes.state_dict()}  # type: ignore
            if self.ranks.size == 1:
                state |= worlds
            else:
                state["worlds"] = {str(rank): part for rank, part in enumerate(self.ranks.collect(worlds))}
        if self.ranks.first:
            checkpoint.save(self.checkpoint_folder, state)

    def load(self, folder: Path | str) -> None:
        """Go on from a checkpoint, in a fresh runner of the same config; every rank reads it whole.

        Raises:
            AgentError: it is damaged, incomplete, or its `meta` is another's.
        """
        state = checkpoint.load(folder)
        missing = [name for name in _SAVED if name not in state]
        if missing:
            raise AgentError(f"{folder} has no {', '.join(missing)}: it is no run of this version; begin a new one")
        checkpoint.check_compatible(state["meta"], self.meta)
        self.agent.load_state_dict(_placed(state["agent"], self.generator.device))
        self.samples, self.iteration, self.fallen = state["samples"], state["iteration"], state["fallen"]
        self.generator.set_state(state["generator"])
        self.watch.load_state_dict(state["watch"])
        parts = {"0": state} if "env" in state else state.get("worlds", {})
        if len(parts) == self.ranks.size:
            worlds = parts[str(self.ranks.rank)]
            self.env.load_state_dict(worlds["env"])  # type: ignore
            self._episodes.load_state_dict(worlds["episodes"])
            self._obs = _placed(worlds["obs"], self.generator.device)
        if self.logger is not None:
            self.logger.resume(self.samples)


def _placed(state: Any, device: torch.device) -> Any:
    """The tensors of a nested dict on the device."""
    if isinstance(state, Mapping):
        return {name: _placed(value, device) for name, value in state.items()}
    return state.to(device) if isinstance(state, Tensor) else state
