"""Help from outside that fades: residual forces, of which less and less is left as the character falls less."""

from dataclasses import dataclass

from gymnasium.vector import VectorEnv

from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.networks import GaussianPolicy
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.ppo import ActorCritic
from murmillo.agents.common.rollout import Rollout

_MEMORY = 0.9
"""Of falls and rewards, from one iteration to the next."""
_TRACKING = "tracking"
"""The reward of `env.tracking`."""
_GONE = 0.01
"""What is left of the forces then goes at once, so that in the end there are none."""


@dataclass
class AssistanceConfig:
    """How residual forces (C·ASE section 3.1) fade; the paper keeps them.

    Attributes:
        fade: share of what is left of them that goes in an iteration; 0 leaves them as they are.
        falls: share of the steps that may end in a fall; while more do, nothing goes.
        tracking: mean reward for following the clips below which nothing goes; 0 asks for none.
        least: share of them that stays for good.
        from_iteration: iterations before anything does.
    """

    fade: float = 0.0
    falls: float = 0.001
    tracking: float = 0.0
    least: float = 0.0
    from_iteration: int = 50

    def __post_init__(self) -> None:
        check_at_least(0, self, "agent.assistance", "fade", "tracking", "least", "from_iteration")
        check_above_zero(self, "agent.assistance", "falls")
        if self.fade >= 1:
            raise AgentError(f"agent.assistance.fade={self.fade}: needs a share of less than 1")
        if self.least > 1:
            raise AgentError(f"agent.assistance.least={self.least}: needs a share, at most 1")


class Assistance:
    """Scales what a policy's mean says of residual forces, by 1 at first.

    The policy carries the share with it (`GaussianPolicy.reach`), so that what is played is what was trained.
    """

    def __init__(self, model: ActorCritic, env: VectorEnv, config: AssistanceConfig) -> None:
        """
        Args:
            model: its policy is scaled.
            env: whose last `residual_dim` numbers of an action are the forces.
            config: how.

        Raises:
            AgentError: something is to fade, and there are no such forces.
        """
        self._config, self._falls, self._tracking = config, 1.0, 0.0
        columns = int(getattr(env, "residual_dim", 0))
        if config.fade and not columns:
            raise AgentError(
                f"agent.assistance.fade={config.fade}: there are no residual forces; "
                "set env.residual_force=50, or this to 0"
            )
        own = config.fade > 0 and isinstance(model.policy, GaussianPolicy)
        self._reach = model.policy.reach[-columns:] if own else None
        """[R], a view; None where nothing fades. An adaptation keeps what its base has left."""

    def update(self, rollout: Rollout, iteration: int) -> dict[str, float]:
        """Let some of the forces go, once an iteration's update is over, if few have fallen; what is left, by name."""
        if self._reach is None:
            return {}
        config, memory = self._config, _MEMORY if iteration else 0.0
        self._falls = memory * self._falls + (1 - memory) * _mean(rollout, "terminated")
        if config.tracking:
            if _TRACKING not in rollout:
                raise AgentError(
                    f"agent.assistance.tracking={config.tracking}: nobody follows a clip; set env.tracking.follow=true"
                )
            self._tracking = memory * self._tracking + (1 - memory) * _mean(rollout, _TRACKING)
        able = self._falls <= config.falls and self._tracking >= config.tracking
        if iteration >= config.from_iteration and able:
            left = self._reach[0].item() * (1 - config.fade)
            self._reach.fill_(max(left if left > _GONE else 0.0, config.least))
        return {"share": self._reach[0].item(), "falls": self._falls}

    def state_dict(self) -> dict[str, float]:
        return {"falls": self._falls, "tracking": self._tracking}

    def load_state_dict(self, state: dict[str, float]) -> None:
        self._falls, self._tracking = state["falls"], state["tracking"]


def _mean(rollout: Rollout, name: str) -> float:
    """Over all steps, worlds and ranks."""
    return rollout.ranks.mean(rollout[name].float().mean()).item()
