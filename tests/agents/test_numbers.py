"""Settings that nothing can be trained with are refused where they are declared."""

import math
import re
from typing import Any

import pytest

from murmillo.agents.adaptnet.ensemble import EnsembleConfig
from murmillo.agents.ase.config import ASEConfig
from murmillo.agents.calm.config import EncoderConfig
from murmillo.agents.case.config import CASEConfig
from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.failures import WatchConfig
from murmillo.agents.common.guided_start import GuidedStartConfig
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.runner import RunnerConfig
from murmillo.agents.common.warm_start import WarmStartConfig


@pytest.mark.parametrize(
    ("config", "name", "value", "line"),
    [
        (PPOConfig, "policy_learning_rate", -1e-4, "agent.ppo.policy_learning_rate=-0.0001: needs at least 0"),
        (PPOConfig, "value_learning_rate", math.nan, "agent.ppo.value_learning_rate=nan: needs at least 0"),
        (PPOConfig, "value_weight", -1.0, "agent.ppo.value_weight=-1.0: needs at least 0"),
        (PPOConfig, "bound_weight", -1.0, "agent.ppo.bound_weight=-1.0: needs at least 0"),
        (PPOConfig, "epochs", 0, "agent.ppo.epochs=0: needs at least 1"),
        (PPOConfig, "minibatch", 0, "agent.ppo.minibatch=0: needs at least 1"),
        (PPOConfig, "std", 0.0, "agent.ppo.std=0.0: needs a number above 0"),
        (PPOConfig, "noise_correlation", 1.0, "agent.ppo.noise_correlation=1.0: needs at least 0 and less than 1"),
        (PPOConfig, "quiet_share", 1.0, "agent.ppo.quiet_share=1.0: needs at least 0 and less than 1"),
        (PPOConfig, "noise_correlation", math.nan, "agent.ppo.noise_correlation=nan: needs at least 0 and less than 1"),
        (PPOConfig, "clip", -1.0, "agent.ppo.clip=-1.0: needs a number above 0"),
        (PPOConfig, "clip", math.nan, "agent.ppo.clip=nan: needs a number above 0"),
        (PPOConfig, "max_grad_norm", 0.0, "agent.ppo.max_grad_norm=0.0: needs a number above 0"),
        (PPOConfig, "target_kl", 0.0, "agent.ppo.target_kl=0.0: needs a number above 0"),
        (PPOConfig, "lead_kl", 0.0, "agent.ppo.lead_kl=0.0: needs a number above 0"),
        (DiscriminatorConfig, "learning_rate", -1.0, "agent.discriminator.learning_rate=-1.0: needs at least 0"),
        (DiscriminatorConfig, "gradient_penalty", -1.0, "agent.discriminator.gradient_penalty=-1.0: needs at least 0"),
        (DiscriminatorConfig, "updates", 0, "agent.discriminator.updates=0: needs at least 1"),
        (EnsembleConfig, "learning_rate", -1.0, "agent.discriminator.learning_rate=-1.0: needs at least 0"),
        (EnsembleConfig, "gradient_penalty", -1.0, "agent.discriminator.gradient_penalty=-1.0: needs at least 0"),
        (EnsembleConfig, "recurrent", 0, "agent.discriminator.recurrent=0: needs at least 1"),
        (EncoderConfig, "uniformity_weight", -1.0, "agent.encoder.uniformity_weight=-1.0: needs at least 0"),
        (EncoderConfig, "minibatch", 1, "agent.encoder.minibatch=1: needs at least 2"),
        (ASEConfig, "kappa", 0.0, "agent.kappa=0.0: needs a number above 0"),
        (CASEConfig, "diversity_weight", -1.0, "agent.diversity_weight=-1.0: needs at least 0"),
        (WarmStartConfig, "learning_rate", -1.0, "warm_start.learning_rate=-1.0: needs at least 0"),
        (GuidedStartConfig, "rounds", -1, "guided_start.rounds=-1: needs at least 0"),
        (GuidedStartConfig, "steps", 0, "guided_start.steps=0: needs at least 1"),
        (WarmStartConfig, "pairs", 0, "warm_start.pairs=0: needs at least 1"),
        (WatchConfig, "memory", 0, "runner.watch.memory=0: needs at least 1"),
        (RunnerConfig, "reward_weights", {"style": math.nan}, "runner.reward_weights.style=nan: needs a finite number"),
        (RunnerConfig, "termination_reward", math.nan, "runner.termination_reward=nan: needs a finite number"),
    ],
)
def test_numbers_that_cannot_be(config: Any, name: str, value: Any, line: str) -> None:
    with pytest.raises(AgentError, match=f"^{re.escape(line)}$"):
        config(**{name: value})


def test_none_and_the_least_that_may_be_are_fine() -> None:
    PPOConfig(max_grad_norm=None, target_kl=None, policy_learning_rate=0.0, value_weight=0.0)
    DiscriminatorConfig(learning_rate=0.0, gradient_penalty=0.0)
    RunnerConfig(reward_weights={"style": -1.0}, termination_reward=-25.0)
