"""What every agent can do with adapters that have learned: take part of them, blend two, merge them (AdaptNet, 9.1)."""

from typing import TYPE_CHECKING, Any

from murmillo.agents.common.adapter import AdaptedPolicy
from murmillo.agents.common.base import MERGED, Base
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.merging import MergedPolicy, merge

if TYPE_CHECKING:
    import torch

    from murmillo.agents.common.ppo import PPO, ActorCritic


class Blending:
    """An agent whose policy may have adapters; what is blended of two, or merged, is for playing."""

    needs: frozenset[str]
    model: "ActorCritic"
    ppo: "PPO"
    optimizer: "torch.optim.Adam"

    @property
    def adapters(self) -> int:
        """How many adapters its policy has; 0 where it was trained from nothing, or merged."""
        policy = self.model.policy
        return len(policy.adapters) if isinstance(policy, AdaptedPolicy) else 0

    @property
    def alpha(self) -> float:
        """How much of the first adapter acts.

        Raises:
            AgentError: the policy has no adapters.
        """
        return self._adapted("blended").strengths[0]

    def blend(self, alpha: float) -> None:
        """How much of the adaptation acts, in [0, 1]; of two, alpha of the first and 1 - alpha of the second.

        At any time, also while it acts (eqs. 13 and 14). 0 is the base, to the last bit.

        Raises:
            AgentError: alpha is outside, or the policy has no adapters.
        """
        self._adapted("blended").blend(alpha)

    def join(self, other: "Blending") -> None:
        """Take in the adapter of another adaptation of the same base, to blend the two.

        Raises:
            AgentError: it is another method's, it adapts another base, or it sees what this one's world does not show.
        """
        own, theirs = self._adapted("joined"), other._adapted("joined")
        if type(other) is not type(self):
            raise AgentError(
                f"an adapter of {type(other).__name__} is none of {type(self).__name__}; adapters of one base alone "
                "can be blended"
            )
        digests = [Base.beneath(agent.model.state_dict()).digest for agent in (other, self)]
        if digests[0] != digests[1]:
            raise AgentError(f"{another_base(*digests)}; adapters of one base alone can be blended")
        if unseen := sorted(name for name in other.needs - self.needs if not name.startswith("next_")):
            raise AgentError(f"its adapter sees {', '.join(unseen)}, which this one's world does not show")
        own.join(theirs.adapters[0])
        self.model.state_normalizer.normalizers.append(other.model.state_normalizer.normalizers[1])

    def merge(self) -> None:
        """Make one network of policy and adapters, as they are blended now; it acts the same, to 1e-5.

        What only learning needs is let go of.

        Raises:
            AgentError: the policy has no adapters, or such as cannot be merged.
        """
        self.model.policy = merge(self._adapted("merged"))
        for optimizer in (self.ppo.optimizer, self.optimizer):
            optimizer.state.clear()

    def _adapted(self, what: str) -> AdaptedPolicy:
        policy = self.model.policy
        if not isinstance(policy, AdaptedPolicy):
            raise AgentError(f"a policy without adapters cannot be {what}; name a run that adapts another's policy")
        return policy

    def _check_learning(self) -> None:
        """Refuse to learn where the policy is for playing. Raises AgentError."""
        if self.adapters > 1 or isinstance(self.model.policy, MergedPolicy):
            raise AgentError("a policy with two adapters, or merged with them, is for playing and learns no more")

    def _merged_state(self) -> dict[str, Any]:
        """What the state of a merged policy has beside its weights; nothing of others."""
        policy = self.model.policy
        return {MERGED: policy.shape.state()} if isinstance(policy, MergedPolicy) else {}


def another_base(theirs: str | None, ours: str | None) -> str:
    """That two adapters have two bases, by the digests of these."""
    shown = [digest[:12] if digest else "none" for digest in (theirs, ours)]
    return f"the adapter's base is another policy (digest {shown[0]}) than this one's ({shown[1]})"
