"""Hyperparameters of ASE."""

from dataclasses import dataclass, field

from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.skill_model import SkillConfig

CHOICES = {"skill_reward": ("log_q", "clamped"), "diversity": ("action", "kl", "none")}


@dataclass
class ASEConfig(SkillConfig):
    """ASE's Table 2, and where it is silent the released code; gamma, lambda and beta are the runner's.

    On `diversity`: at std 0.05 the paper's KL divergence is 200 ||mu - mu'||^2, and eq. 15 wants it equal to D_z <= 1.
    Two opposite skills should then differ by 0.013 in each of 31 actions, a quarter of the exploration noise, and all
    that tells them apart further is punished. The published results come from the code's form, which wants a mean
    squared difference of D_z instead. So "action" is the default here, and "kl" the paper's letter.

    Attributes:
        latent_dim: Z.
        latent_steps: shortest and longest time that a latent is kept [control steps].
        window: W, frames that discriminator and encoder see; (s, s') is 2, the released code has 10.
        kappa: the encoder's concentration.
        skill_discovery: train the encoder and give the "skill" reward; without it, weight no such term.
        skill_reward: "log_q" (paper) or "clamped" (released code).
        diversity: "action" (released code), "kl" (paper) or "none" (ablation).
        diversity_weight: w_div.
        shared_trunk: the encoder is a second head of the discriminator (paper), or has a trunk of its own.
        discriminator: discriminator and encoder.
    """

    latent_dim: int = 64
    latent_steps: tuple[int, int] = (1, 150)
    window: int = 10
    kappa: float = 1.0
    skill_discovery: bool = True
    skill_reward: str = "log_q"
    diversity: str = "action"
    diversity_weight: float = 0.01
    shared_trunk: bool = True
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise AgentError(f"agent.{name}={getattr(self, name)} is not one of {', '.join(choices)}")
        check_above_zero(self, "agent", "kappa")
        check_at_least(0, self, "agent", "diversity_weight")
