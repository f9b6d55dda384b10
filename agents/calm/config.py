"""Hyperparameters of CALM."""

from dataclasses import dataclass, field

from murmillo.agents.common.discriminator import DiscriminatorConfig
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.numbers import check_at_least
from murmillo.agents.common.skill_model import SkillConfig

NEGATIVES = ("sphere", "shuffled", "none")


@dataclass
class EncoderConfig:
    """Structure and training of the motion encoder (CALM, sections 5.1.1 and A.2); it steps with the policy.

    Attributes:
        frames: F, length of a motion; 60 are the paper's 2 s.
        stride: every how many frames the network sees one, the last one always.
        hidden: sizes of its layers.
        shift: longest shift between two overlapping motions of the alignment loss [frames]; 15 are 0.5 s.
        alignment_weight: of eq. 5.
        uniformity_weight: of eq. 6.
        minibatch: motions that the two are estimated on.
        pool: motions that are drawn anew for every update; its minibatches of true motions come out of them.
    """

    frames: int = 60
    stride: int = 1
    hidden: tuple[int, ...] = (1024, 1024, 512)
    shift: int = 15
    alignment_weight: float = 0.1
    uniformity_weight: float = 0.05
    minibatch: int = 4096
    pool: int = 16384

    def __post_init__(self) -> None:
        check_at_least(0, self, "agent.encoder", "alignment_weight", "uniformity_weight")
        check_at_least(2, self, "agent.encoder", "minibatch")  # the losses compare motions


@dataclass
class CALMConfig(SkillConfig):
    """CALM's appendix, and where it is silent the released code; gamma and lambda are the runner's.

    Attributes:
        latent_dim: Z.
        latent_steps: shortest and longest time that a motion is followed [control steps].
        window: W, frames that the discriminator sees.
        negatives: true windows that the discriminator is to refuse, since they come with a latent that is not theirs:
            "sphere" draws it uniformly (eq. 7), "shuffled" takes another motion's encoding, "none" leaves such windows
            out (the released code's default).
        discriminator_style_hidden: hidden sizes of the network that the latent passes before the discriminator.
        discriminator: the conditional discriminator.
        encoder: the motion encoder.
    """

    latent_dim: int = 64
    latent_steps: tuple[int, int] = (10, 149)
    window: int = 10
    negatives: str = "sphere"
    discriminator_style_hidden: tuple[int, ...] = (512, 256)
    discriminator: DiscriminatorConfig = field(default_factory=DiscriminatorConfig)
    encoder: EncoderConfig = field(default_factory=EncoderConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.negatives not in NEGATIVES:
            raise AgentError(f"agent.negatives={self.negatives} is not one of {', '.join(NEGATIVES)}")
        encoder = self.encoder
        if not self.window <= encoder.frames:
            raise AgentError(
                f"agent.encoder.frames={encoder.frames}: the discriminator's windows lie inside the motion; "
                f"needs at least agent.window={self.window}"
            )
        needed = max(encoder.minibatch, self.discriminator.minibatch)
        if encoder.pool < needed:
            raise AgentError(f"agent.encoder.pool={encoder.pool}: minibatches come out of it; needs at least {needed}")
        if not 1 <= encoder.stride <= encoder.frames or encoder.shift < 0:
            raise AgentError(
                f"agent.encoder: stride={encoder.stride} must be 1 to frames={encoder.frames}, and "
                f"shift={encoder.shift} at least 0"
            )
