"""By what a policy is adapted, and what that costs (AdaptNet, Xu et al. 2023b, eq. 12); of every method alike."""

from dataclasses import dataclass, field

import torch
from torch import Tensor

from murmillo.agents.common.adapter import INJECTION, AdaptedPolicy, AdapterConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import Policy, Told, by_name
from murmillo.agents.common.normalizer import RunningNormalizer
from murmillo.agents.common.ppo import Minibatch


@dataclass
class AdaptationConfig:
    """What counts only where an agent is given a base; the agents' configurations begin with it.

    Attributes:
        adapter: what is changed.
        injection_penalty: beta of eq. 12, on the length of what is added to the latents. 0.01 does for all styles;
            tasks that are no styles need none (section 10.2).
        weight_decay: kappa of eq. 12, on the squared weights of the adaptors; the paper does not say how much.
    """

    adapter: AdapterConfig = field(default_factory=AdapterConfig)
    injection_penalty: float = 0.01
    weight_decay: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("injection_penalty", "weight_decay"):
            if not getattr(self, name) >= 0:  # so written, a NaN is refused too
                raise AgentError(f"agent.{name}={getattr(self, name)}: a penalty is 0 or more")


def announce(policy: Policy, batch: Minibatch, told: Told) -> Told:
    """What a policy is told of a minibatch; an adapted one its injection too, which `penalties` then finds there."""
    if not isinstance(policy, AdaptedPolicy) or not policy.adapters[0].spaces:
        return told
    batch[INJECTION] = policy.injection(batch["state"], told)
    return {**by_name(told), INJECTION: batch[INJECTION]}


def penalties(policy: Policy, batch: Minibatch, config: AdaptationConfig) -> dict[str, Tensor]:
    """The penalties of eq. 12 by name, weighted; none of a policy that is not adapted.

    Args:
        policy: that learns.
        batch: in which `announce` has put the injection `[B, sum Z^i]`, if there is one.
        config: the weights.
    """
    if not isinstance(policy, AdaptedPolicy):
        return {}
    decay = {"decay": config.weight_decay * policy.adapters[0].size()}
    if INJECTION not in batch:
        return decay
    return {"injection": config.injection_penalty * batch[INJECTION].norm(dim=-1).mean(), **decay}


def frozen(module: torch.nn.Module) -> None:
    """Let a network learn nothing more, and its normalisers neither."""
    module.requires_grad_(False)
    for part in module.modules():
        if isinstance(part, RunningNormalizer):
            part.freeze()
