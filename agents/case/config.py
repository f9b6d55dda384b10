"""Hyperparameters of C·ASE."""

from dataclasses import dataclass, field

from murmillo.agents.common.assistance import AssistanceConfig
from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.numbers import check_above_zero, check_at_least
from murmillo.agents.common.ppo import PPOConfig
from murmillo.agents.common.skill_model import SkillConfig

CHOICES = {
    "focal": ("paper", "normalised", "code", "none"),
    "skill_reward": ("log_q", "clamped"),
    "diversity": ("action", "kl", "none"),
}


@dataclass
class CASEConfig(SkillConfig):
    """The numbers of C·ASE's appendix A.5, and ASE's where it names none; discount, lambda and beta are the runner's.

    Discriminator and encoder see the whole state. Appendix A.4.1 leaves sword and shield out of theirs, while A.5 masks
    just these for clips that had neither, which would then be nothing to mask; the released code leaves nothing out.

    Attributes:
        latent_dim: Z.
        latent_steps: shortest and longest time that a latent is kept [control steps].
        label_dim: size of a label's embedding, which has unit length.
        window: W, frames that discriminator and encoder see.
        kappa: the encoder's concentration.
        skill_discovery: train the encoder and give the "skill" reward; without it, weight no such term.
        skill_reward: "log_q" (paper) or "clamped" (released code).
        diversity: "action" (released code), "kl" (paper) or "none"; `ASEConfig` says why the paper's is no default.
        diversity_weight: w_div.
        encoder_hidden: sizes of the encoder's layers, which is no head of the discriminator here.
        focal: form of the focal skill sampling, see `FocalSampling`; "none" draws all skills alike.
        focal_rate: alpha of eq. 4.
        focal_start: iterations before the sampling leaves the uniform.
        focal_floor: least probability of a skill, as a share of the uniform (released code).
        focal_steps: whether a skill's share is one of the steps and not of the episodes: what falls early would else be
            practised least.
        assistance: how residual forces fade.
        upright_iterations: first iterations in which only the feet may touch the ground; 0 for no such curriculum.
        discriminator: its dropout is the element-wise feature masking.
    """

    latent_dim: int = 16
    latent_steps: tuple[int, int] = (1, 150)
    label_dim: int = 64
    window: int = 20
    kappa: float = 1.0
    skill_discovery: bool = True
    skill_reward: str = "log_q"
    diversity: str = "action"
    diversity_weight: float = 0.01
    encoder_hidden: tuple[int, ...] = (1024, 1024, 512)
    focal: str = "paper"
    focal_rate: float = 0.2
    focal_start: int = 2500
    focal_floor: float = 0.01
    focal_steps: bool = False
    upright_iterations: int = 15_000
    assistance: AssistanceConfig = field(default_factory=AssistanceConfig)
    ppo: PPOConfig = field(default_factory=lambda: PPOConfig(style_hidden=()))
    discriminator: DiscriminatorConfig = field(
        default_factory=lambda: DiscriminatorConfig(hidden=(1024, 512), dropout=0.2)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise AgentError(f"agent.{name}={getattr(self, name)} is not one of {', '.join(choices)}")
        for name in ("focal_rate", "focal_floor"):
            if not 0 < getattr(self, name) <= 1:
                raise AgentError(f"agent.{name}={getattr(self, name)}: needs a share above 0, at most 1")
        check_above_zero(self, "agent", "kappa")
        check_at_least(0, self, "agent", "diversity_weight", "focal_start", "upright_iterations")
