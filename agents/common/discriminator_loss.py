"""What a discriminator learns by: of ASE, CALM and C·ASE, and the pieces that AdaptNet's ensemble shares."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from murmillo.agents.common.discriminator import Discriminator, Windows, leave_out
from murmillo.agents.common.ranks import ALONE, Part


@dataclass(frozen=True)
class DiscriminatorLoss:
    """Weighted parts of the loss and scores to log, by name; the agent's windows again, for an encoder.

    Attributes:
        agent_inputs: prepared windows `[B, W D]`.
        agent_features: the trunk's features of them `[B, H]`, with their graph.
    """

    parts: dict[str, Tensor]
    scores: dict[str, Tensor]
    agent_inputs: Tensor
    agent_features: Tensor


def discriminator_loss(
    discriminator: Discriminator,
    agent: Windows,
    replay: Windows,
    demonstration: Windows,
    negative: Windows | None = None,
    *,
    generator: torch.Generator,
    update: int = 0,
) -> DiscriminatorLoss:
    """ASE's eq. 14 with the regularisers of the released code, as named parts whose sum is minimised.

        1/2 [ L(agent, replay and negative, 0) + L(demonstration, 1) ] + w_gp P
            + logit_decay ||w_logit||^2 + weight_decay ||w||^2

    Eq. 14 sums its two expectations without the 1/2; with it, w_gp = 5 means what it means in the released code.
    `negative` are true windows under a condition that is not theirs (CALM, eq. 7).

    Of loss "logistic" L is the binary cross-entropy and P is E ||d logit / dx||^2 at the *normalised* demonstrations,
    since only so is the weight free of units, and before their masks, since what a clip leaves out is no input of its
    logit. Of loss "hinge" (AdaptNet, eq. 10) L is max(0, 1 + logit) and max(0, 1 - logit), and P is
    E (||d logit / dx|| / slope - 1)^2 at windows that `generator` draws between those of the agent and of the
    demonstrations, of which there must be equally many, under the condition of the latter: such a discriminator goes
    on telling better from worse where the other is sure of both.

    With `penalty_every` = k, P counts in the updates 0, k, 2 k, ... of an iteration alone, k times as much, and is 0 in
    the others; `update` says which this is.
    """
    config = discriminator.config
    hinge = config.loss == "hinge"
    penalised = update % config.penalty_every == 0
    loss = _hinge if hinge else F.softplus
    discriminator.train()  # dropout is for these losses only
    x, told = discriminator.normalizer(demonstration.window), demonstration.condition
    x.requires_grad_(penalised and not hinge)
    demo_inputs = leave_out(x, demonstration.mask).flatten(1)
    demo_logits = discriminator.judge(discriminator.features(demo_inputs, told), told)
    agent_inputs = discriminator.prepare(agent.window, agent.mask)
    agent_features = discriminator.features(agent_inputs, agent.condition)
    agent_logits = discriminator.judge(agent_features, agent.condition)
    replay_logits = discriminator.logits(*replay[:3])

    fakes = {"agent": (agent, agent_logits), "replay": (replay, replay_logits)}
    if negative is not None:
        fakes["negative"] = negative, discriminator.logits(*negative[:3])
    if not penalised:
        penalty = demo_logits.new_zeros(())
    elif hinge:
        between = interpolate(agent_inputs, demo_inputs, demonstration.part, generator)
        seen = leave_out(between.view_as(x), demonstration.mask).flatten(1)
        logits = discriminator.judge(discriminator.features(seen, told), told)
        penalty = slope_penalty(logits, between, config.slope)
    else:
        penalty = gradient_penalty(demo_logits, x)
    discriminator.eval()
    share = 0.5 / sum(windows.total for windows, _ in fakes.values())
    real = demonstration.weight
    weights = [layer.weight for layer in discriminator.trunk if isinstance(layer, nn.Linear)]
    logit_square = discriminator.head.weight.square().sum()
    parts = {
        **{
            name: share * (windows.weight * windows.total / len(logits)) * loss(logits).sum()
            for name, (windows, logits) in fakes.items()
        },
        "demonstration": 0.5 * real * loss(-demo_logits).mean(),
        "gradient_penalty": config.penalty_every * config.gradient_penalty * real * penalty,
        "logit_decay": config.logit_decay * logit_square,
        "weight_decay": config.weight_decay * (logit_square + sum(weight.square().sum() for weight in weights)),
    }
    with torch.no_grad():
        scores = {
            "agent_score": agent.weight * discriminator.score(agent_logits).mean(),
            "demonstration_score": real * discriminator.score(demo_logits).mean(),
            "agent_accuracy": agent.weight * (agent_logits < 0).float().mean(),
            "demonstration_accuracy": real * (demo_logits > 0).float().mean(),
        }
    return DiscriminatorLoss(parts, scores, agent_inputs, agent_features)


def _hinge(x: Tensor) -> Tensor:
    return F.relu(1 + x)


def interpolate(fake: Tensor, real: Tensor, part: Part | None, generator: torch.Generator) -> Tensor:
    """Inputs `[B, ...]` on the lines between two as many, which are this part of all ranks'; a leaf to differentiate
    by."""
    part = part or Part(ALONE, len(real))
    share = part.of(torch.rand(part.total, 1, generator=generator))
    return torch.lerp(fake.detach(), real.detach(), share).requires_grad_()


def gradient_penalty(logits: Tensor, x: Tensor) -> Tensor:
    """E ||d logit / dx||^2 of logits `[B]` at the inputs `[B, ...]` that they came from, ready to be differentiated."""
    return input_gradient(logits, x).square().sum(-1).mean()


def slope_penalty(logits: Tensor, x: Tensor, slope: float) -> Tensor:
    """E (||d logit / dx|| / slope - 1)^2 of logits at the inputs that they came from, as for `gradient_penalty`."""
    return (input_gradient(logits, x).norm(dim=1) / slope - 1).square().mean()


def input_gradient(logits: Tensor, x: Tensor) -> Tensor:
    """d logit / dx, flat `[B, ...]`, of logits `[B]`, or of the sum of logits `[B, H]`, ready to be differentiated."""
    (gradient,) = torch.autograd.grad(logits.sum(), x, create_graph=True)
    return gradient.flatten(1)
