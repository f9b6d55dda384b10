"""Iterations of training, timed by their parts."""

import os
import time
from operator import attrgetter
from typing import Any

import torch

from murmillo.agents.common.exactness import choose, exactness
from murmillo.agents.common.runner import Runner
from murmillo.cli import agents, checks, versions
from murmillo.cli import config as configuration
from murmillo.cli.adaptation import checks as adaptation_checks
from murmillo.cli.adaptation import config as adaptation_config
from murmillo.cli.adaptation import world
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.adaptation.words import are_about_adaptnet
from murmillo.cli.benching.turns import Rates
from murmillo.cli.config import TrainConfig
from murmillo.cli.devices import for_training
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.devices import on

ROLLOUT = "rollout"
UPDATE = "learner update"
ITERATION = "training iteration"

_PER_SAMPLE = (
    "num_envs",
    "agent.ppo.minibatch",
    "agent.discriminator.minibatch",
    "agent.discriminator.replay_size",
    "agent.encoder.minibatch",
    "agent.encoder.pool",
)
"""Settings that grow with the samples of an iteration."""


def compose(words: list[str]) -> TrainConfig | AdaptNetTrainConfig:
    """The settings of a training of any agent, checked.

    Raises:
        CommandError, SuiteError: a setting that is not there or cannot be.
    """
    if are_about_adaptnet(words):
        adapting = adaptation_config.compose_adaptnet(words)
        adaptation_checks.check_settings(adapting, None)
        return adapting
    config = configuration.compose_train(words)
    checks.check_settings(config)
    checks.check_clips(config)
    return config


def shrunk(config: Any, fraction: int) -> list[str]:
    """Words that give an iteration of `config` a fraction of its worlds, in a fraction of its minibatches.

    Its networks and the number of its gradient steps stay what they are.
    """
    found = []
    for name in _PER_SAMPLE:
        try:
            value = attrgetter(name)(config)
        except AttributeError:  # agents differ in what they have
            continue
        found.append(f"{name}={max(1, value // fraction)}")
    return found


class Learning:
    """A training run without folder, log and warm start; a contestant of `turns`.

    A turn is an iteration: samples a second of the rollout alone, of what is learned from it, and of both.
    """

    def __init__(self, config: TrainConfig | AdaptNetTrainConfig, label: str = "") -> None:
        """
        Args:
            config: checked.
            label: behind the names of its figures.

        Raises:
            AgentError, SuiteError: agent or environment cannot be made so.
        """
        torch.set_num_threads(config.threads or versions.usable_cores())
        self.label = label
        env, agent, generator = _make(config)
        self._exactness = choose(getattr(config, "matmul", "highest"), env.device)
        self._runner = Runner(env, agent, config.runner, generator, os.devnull)  # which nothing is saved to
        self.samples = env.num_envs * config.runner.horizon

    @property
    def env(self) -> HumanoidVectorEnv:
        env = self._runner.env
        assert isinstance(env, HumanoidVectorEnv)
        return env

    def warm_up(self) -> None:
        """One rollout: the first touches memory that the others find ready."""
        with on(self.env.device):
            self._runner._direct()
            self._runner._collect()

    def turn(self) -> Rates:
        with on(self.env.device), exactness(self._exactness):
            return self._iterate()

    def _iterate(self) -> Rates:
        runner = self._runner
        begin = self._now()
        runner._direct()
        rollout = runner._collect()
        collected = self._now()
        runner._reward(rollout)
        runner._advantage(rollout)
        runner.agent.update(rollout)
        end = self._now()
        seconds = {ROLLOUT: collected - begin, UPDATE: end - collected, ITERATION: end - begin}
        return {name + self.label: self.samples / taken for name, taken in seconds.items()}

    def close(self) -> None:
        self._runner.env.close()

    def _now(self) -> float:
        """[s], after all that a GPU has been told to do."""
        if torch.cuda.is_initialized():
            torch.cuda.synchronize()
        return time.perf_counter()


def _make(config: TrainConfig | AdaptNetTrainConfig) -> tuple[HumanoidVectorEnv, Any, torch.Generator]:
    if isinstance(config, AdaptNetTrainConfig):
        env = world.make_env(config, config.num_envs, training=True)
        with on(env.device):
            return env, *world.make_agent(config, None, env)
    env = HumanoidVectorEnv(config.num_envs, for_training(config.env))
    with on(env.device):
        return env, *agents.make_agent(config.choices["agent"], config.agent, env, config.seed)
