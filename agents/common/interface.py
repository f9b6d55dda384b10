"""What the runner asks of an agent, and what an agent asks of its demonstrations."""

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor

from murmillo.agents.common.rollout import Rollout

Obs = dict[str, Tensor]
"""Named observations, float32 or int64 tensors `[N, ...]`: "state", "skill" and, where asked for, "window"."""


@dataclass(frozen=True)
class Step:
    """One action of every world.

    Attributes:
        action: `[N, A]`, as drawn; the environment clamps it to [-1, 1], the log probability is of the unclamped one.
        log_prob: `[N]`.
        extras: what the agent must see again when it learns from this step, `[N, ...]` each: a latent, a label.
        quiet: `[N]` bool, the worlds whose action has no noise: their policy learns nothing from this step, their
            critic does; None where all have.
    """

    action: Tensor
    log_prob: Tensor
    extras: dict[str, Tensor] = field(default_factory=dict)
    quiet: Tensor | None = None


class Agent(Protocol):
    """A learner. It owns its networks, optimisers and latents, and neither environment nor loop."""

    needs: frozenset[str]
    """The observations it reads again after collection, as rollout fields: "state", "next_state", "next_window", ..."""

    def act(self, obs: Obs, *, deterministic: bool = False) -> Step:
        """Act once in every world; advances the clocks of the latents."""
        ...

    def value(self, obs: Obs, extras: dict[str, Tensor]) -> Tensor:
        """Expected return `[...]` of observations `[..., D]`, in the reward's own units; `[..., C]` of C objectives."""
        ...

    def reset(self, env_ids: Tensor) -> None:
        """Begin new episodes in these worlds (`[n]` int64): redraw latents and labels."""
        ...

    def rewards(self, rollout: Rollout) -> dict[str, Tensor]:
        """The agent's own reward terms by name, each `[T, N]`; the runner weights, sums and logs them."""
        ...

    def update(self, rollout: Rollout) -> dict[str, float]:
        """Learn from a rollout with "advantage" (normalised) and "return"; the means of losses and scores, by name."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """All that changes while training, as nested dicts of tensors and JSON values."""
        ...

    def load_state_dict(self, state: dict[str, Any]) -> None: ...


@runtime_checkable
class Directing(Protocol):
    """An agent that also says what the next episodes should be like."""

    def directions(self) -> dict[str, Any]:
        """Settings of the environment by name, each for its method `set_<name>`, told before every iteration."""
        ...


@runtime_checkable
class MultiObjective(Protocol):
    """An agent with a critic for each of several reward terms (Xu et al. 2023), whose `value` is `[..., C]`.

    The runner's weights are then not those of rewards in a sum but of the objectives' normalised advantages.
    """

    objectives: tuple[str, ...]
    """The C reward terms, in the order of the critics."""


@runtime_checkable
class Steerable(Protocol):
    """An agent whose latents somebody else may choose: an evaluation, or a policy above it."""

    latent_dim: int
    """Z."""

    def draw_latents(self, n: int) -> Tensor:
        """Latents `[n, Z]` as they are drawn in training."""
        ...

    def follow(self, latent: Tensor) -> None:
        """Act under these latents `[N, Z]`, or `[Z]` in all worlds, until the next `reset`."""
        ...


@runtime_checkable
class Labelled(Protocol):
    """An agent that is told a skill, and knows more of each than fits into a log."""

    def skill_tables(self) -> dict[str, Tensor]:
        """Figures of each skill `[K]` by name, for the report."""
        ...

    def head_scores(self, rollout: Rollout) -> dict[str, Tensor]:
        """What the discriminator gives to each motion `[T, N]` under its label, "right", and under others, "other".

        Scores, 0 to 1; there is no "other" where there is only one label.
        """
        ...


class Demonstrations(Protocol):
    """Draws windows of the reference motions: `{"window": [n, W, D], "skill": [n]}`, oldest frame first.

    `frames` asks for windows of another length than the environment's; they lie within their clips where those are long
    enough, and begin with a clip's first frame, repeated, where not.
    A third entry, `mask` [n, D] bool, may say which features of a window are not to be judged by.
    `rows` asks for these of the n only, drawn as if all were made; only a run of several ranks does.
    """

    def __call__(
        self,
        n: int,
        generator: torch.Generator,
        skill: Tensor | None = None,
        frames: int | None = None,
        rows: Tensor | slice | None = None,
    ) -> dict[str, Tensor]: ...


class ImitationPairs(Protocol):
    """Draws states of the reference motions, their labels, and the actions that lead on.

    `{"state": [n, D], "skill": [n], "action": [n, A]}`.
    """

    def __call__(self, n: int, generator: torch.Generator) -> dict[str, Tensor]: ...
