"""The figures that the progress display and the report show: which scalar, its name, its unit and what it means."""

from typing import NamedTuple


class Metric(NamedTuple):
    """A scalar of the log.

    Attributes:
        scalar: its name in `scalars.csv` and TensorBoard.
        title: its name for a reader.
        unit: of the value as shown.
        digits: behind the point.
        meaning: for a newcomer, and which way is good.
    """

    scalar: str
    title: str
    unit: str
    digits: int
    meaning: str

    def show(self, value: float | None) -> str:
        """The value as text with its unit, a dash where there is none."""
        if value is None or value != value:
            return "-"
        return f"{value:.{self.digits}f}{f' {self.unit}' if self.unit else ''}"


EPISODE_LENGTH = Metric(
    "episode/length",
    "Episode length",
    "steps",
    0,
    "control steps (30 a second) from a start to a fall or to the clock. Up is good: the character stays on its feet.",
)
FALL_RATE = Metric(
    "episode/fall_rate",
    "Fall rate",
    "",
    2,
    "share of the episodes that ended in a fall rather than by the clock. Down is good, but it falls late: a policy "
    "that stands for 8 of 10 seconds still has 1.",
)
STYLE = Metric(
    "reward/style",
    "Style reward",
    "",
    3,
    "-log(1 - D), where D is the discriminator's probability that the motion is a clip; of a hinge "
    "(agent.discriminator.loss) its score. Up is good, yet the judge learns too: a level line means that the character "
    "keeps up with it.",
)
SKILL = Metric(
    "reward/skill",
    "Skill reward",
    "",
    3,
    "how well the encoder guesses the latent from the motion, -1 to 1. Up means that different latents look different.",
)
AGENT_SCORE = Metric(
    "discriminator/agent_score",
    "Discriminator on the agent",
    "",
    3,
    "how much like a clip it finds the agent's motion, 0 to 1. Near 0 the judge sees through it at once.",
)
CLIP_SCORE = Metric(
    "discriminator/demonstration_score",
    "Discriminator on the clips",
    "",
    3,
    "the same for true clips. The two meet when the judge cannot tell them apart.",
)

COMMANDED = Metric(
    "heads/agent_right",
    "Commanded skill's head",
    "",
    3,
    "score, 0 to 1, that the discriminator's head of the commanded skill gives to the agent's motion.",
)
OTHER_HEADS = Metric(
    "heads/agent_other",
    "Other skills' heads",
    "",
    3,
    "the mean that all other heads give to the same motion. Well below the commanded one's: the label is obeyed.",
)
RIGHT_LABEL = Metric(
    "heads/demonstration_right",
    "Clips under their label",
    "",
    3,
    "score of true clips by the head of their own label.",
)
WRONG_LABEL = Metric(
    "heads/demonstration_other",
    "Clips under a wrong label",
    "",
    3,
    "the same by the heads of all other labels. Well below: the discriminator knows the labels apart.",
)
MISMATCHED = Metric(
    "discriminator/agent_mismatched_score",
    "Agent under another latent",
    "",
    3,
    "score that the discriminator gives to the agent's motion when it is told that another motion was asked for. "
    "Well below that on the agent: the character does what its latent says.",
)
RESIDUAL = Metric(
    "reward/residual",
    "Residual reward",
    "",
    3,
    "for doing without residual forces: 1 without any, towards 0 with strong ones at many joints.",
)

TRAINING = (EPISODE_LENGTH, FALL_RATE, STYLE, SKILL, RESIDUAL, AGENT_SCORE, CLIP_SCORE, MISMATCHED)
LABELS = (COMMANDED, OTHER_HEADS, RIGHT_LABEL, WRONG_LABEL)
