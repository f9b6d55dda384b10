"""Help from outside that fades: residual forces, of which each skill keeps what it cannot do without."""

from dataclasses import dataclass

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor, nn

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.rollout import Rollout

_MEMORY = 0.97
"""Of falls and rewards, from one iteration to the next: of 4,096 samples few are of one skill."""
_SLACK = 0.05
"""What was taken comes back where following earns so much less of its best than is asked, or twice as many fall."""
_TRACKING = "tracking"
"""The reward of `env.tracking`."""
_GONE = 0.01
"""What is left of the forces then goes at once, so that in the end there are none."""


@dataclass
class AssistanceConfig:
    """How residual forces (C·ASE section 3.1) fade, skill by skill; the paper keeps them.

    Attributes:
        fade: share of what a skill has left that goes in an iteration; 0 leaves all as it is.
        falls: share of a skill's steps that may end in a fall; while more do, nothing goes.
        follows: share of the best that a skill has earned by following its clips below which nothing goes; 0 for none.
        least: share of the forces that stays for good.
        from_iteration: iterations before anything does.
    """

    fade: float = 0.0
    falls: float = 0.001
    follows: float = 0.0
    least: float = 0.0
    from_iteration: int = 50

    def __post_init__(self) -> None:
        check_at_least(0, self, "agent.assistance", "fade", "follows", "least", "from_iteration")
        check_above_zero(self, "agent.assistance", "falls")
        if self.fade >= 1:
            raise AgentError(f"agent.assistance.fade={self.fade}: needs a share of less than 1")
        for name in ("follows", "least"):
            if getattr(self, name) > 1:
                raise AgentError(f"agent.assistance.{name}={getattr(self, name)}: needs a share, at most 1")


class Assistance(nn.Module):
    """Scales what a policy's mean says of residual forces, by 1 at first.

    Its state goes with the policy's, so that what is played is what was trained.
    """

    share: Tensor
    """[K] of the forces that each skill has left."""
    falls: Tensor
    """[K] share of its steps that end in a fall, of late."""
    follows: Tensor
    """[K] what following its clips has earned of late."""
    best: Tensor
    """[K] the most that it has."""
    updates: Tensor
    """[K] iterations in which it was practised."""

    def __init__(self, skills: int, env: VectorEnv, config: AssistanceConfig, *, fades: bool = True) -> None:
        """
        Args:
            skills: K.
            env: whose last `residual_dim` numbers of an action are the forces.
            config: how.
            fades: whether any go; an adaptation keeps what its base has left.

        Raises:
            AgentError: something is to fade, and there are no such forces.
        """
        super().__init__()
        self._config, self._fades = config, fades and config.fade > 0
        columns, actions = int(getattr(env, "residual_dim", 0)), int(env.single_action_space.shape[0])  # type: ignore[index]
        if config.fade and not columns:
            raise AgentError(
                f"agent.assistance.fade={config.fade}: there are no residual forces; "
                "set env.residual_force=20, or this to 0"
            )
        self._forces = torch.arange(actions) >= actions - columns if columns else None
        self.register_buffer("share", torch.ones(skills))
        self.register_buffer("falls", torch.zeros(skills))
        self.register_buffer("follows", torch.zeros(skills))
        self.register_buffer("best", torch.zeros(skills))
        self.register_buffer("updates", torch.zeros(skills))

    @property
    def helps(self) -> bool:
        """Whether there are such forces."""
        return self._forces is not None

    def reach(self, label: Tensor) -> Tensor | None:
        """What is left of each number of an action under labels [...], [..., A]; None where nobody is helped."""
        if self._forces is None:
            return None
        return torch.where(self._forces.to(label.device), self.share[label].unsqueeze(-1), 1.0)

    def update(self, rollout: Rollout, iteration: int) -> dict[str, float]:
        """Let some of the forces go, once an iteration's update is over; what is left, on average and at most, by name.

        They go where few fall and the clips are followed nearly as well as ever, and come back where that is lost.
        """
        if not self._fades:
            return {}
        config = self._config
        if config.follows and _TRACKING not in rollout:
            raise AgentError(
                f"agent.assistance.follows={config.follows}: nobody follows a clip; set env.tracking.follow=true"
            )
        labels, ranks = rollout["label"].flatten(), rollout.ranks
        count = ranks.sum(torch.bincount(labels, minlength=len(self.share)))
        memory = (1.0 - 1.0 / (self.updates + 1.0)).clamp(max=_MEMORY)
        seen = count > 0
        for known, name in ((self.falls, "terminated"), (self.follows, _TRACKING)):
            if name in rollout:
                total = torch.zeros_like(known).index_add(0, labels, rollout[name].flatten().float())
                mean = ranks.sum(total) / count
                known.copy_(torch.where(seen, memory * known + (1.0 - memory) * mean, known))
        self.updates += seen
        if iteration < config.from_iteration:
            return self._scalars()
        self.best.copy_(torch.maximum(self.best, self.follows))
        able = (self.falls <= config.falls) & (self.follows >= config.follows * self.best)
        lost = (self.falls > 2 * config.falls) | (self.follows < (config.follows - _SLACK) * self.best)
        share = torch.where(able, self.share * (1 - config.fade), self.share)
        share = torch.where(able & (share < _GONE), 0.0, share)
        share = torch.where(lost, share.clamp_min(_GONE) * (1 + config.fade), share)
        self.share.copy_(torch.where(seen, share.clamp(config.least, 1.0), self.share))
        return self._scalars()

    def _scalars(self) -> dict[str, float]:
        return {"share": self.share.mean().item(), "greatest": self.share.max().item()}
