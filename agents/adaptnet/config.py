"""Hyperparameters of AdaptNet."""

import math
from dataclasses import dataclass, field

from murmillo.agents.adaptnet.ensemble import EnsembleConfig
from murmillo.agents.common.adaptation import AdaptationConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.ppo import PPOConfig

METHODS = ("adaptnet", "finetune", "progressive")


@dataclass
class AdaptNetConfig(AdaptationConfig):
    """The released code's numbers; the paper's appendix, which lists them, is not at hand.

    gamma and lambda (0.95 both), the weights of the objectives (0.5 each) and the reward of a termination (-25) are the
    runner's.

    Attributes:
        window: W, frames that the discriminators see.
        recurrent: units of the GRU that reads the last states, in the policy and in the critic.
        method: how a base policy is adapted: "adaptnet", or the paper's baselines "finetune" (FT; with `weight_decay`
            FT + Reg, on the squares of all that it trains) and "progressive" (PNet). Without a base the policy is
            trained from nothing ("Scratch").
        popart: momentum of the returns' statistics.
        ppo: policy and critic; `std` is where the state-dependent one begins.
        discriminator: the ensemble.
    """

    window: int = 5
    recurrent: int = 256
    method: str = "adaptnet"
    popart: float = 0.1
    ppo: PPOConfig = field(
        default_factory=lambda: PPOConfig(
            hidden=(1024, 512),
            style_hidden=(),
            std=math.exp(-3),
            policy_learning_rate=5e-6,
            value_learning_rate=1e-4,
            epochs=5,
            minibatch=256,
            bound_weight=0.0,
            value_weight=0.5,
            max_grad_norm=1.0,
        )
    )
    discriminator: EnsembleConfig = field(default_factory=EnsembleConfig)

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise AgentError(f"agent.method={self.method} is not one of {', '.join(METHODS)}")
        super().__post_init__()
        check_at_least(1, self, "agent", "recurrent")
        if not 0 < self.popart <= 1:
            raise AgentError(f"agent.popart={self.popart}: needs a share above 0, at most 1")
