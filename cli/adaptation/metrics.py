"""The scalars of AdaptNet's log, as the progress display and the report show them."""

from murmillo.cli.metrics import EPISODE_LENGTH, FALL_RATE, Metric

GOAL = Metric(
    "reward/task",
    "Goal reward",
    "",
    3,
    "for going to the target at the speed that it takes, 0 to 1 in a control step. Up is good.",
)
IMITATION = Metric(
    "reward/imitation",
    "Imitation reward",
    "",
    3,
    "mean of what the discriminators give, each cut off to -1 to 1 (eq. 11). Up is good, yet they learn too: a level "
    "line means that the character keeps up with them.",
)
_AGENT = Metric(
    "discriminator/agent_score",
    "Discriminators on the agent",
    "",
    3,
    "their mean on the agent's motion. Below -1 it is told from the clips without a doubt.",
)
_CLIPS = Metric(
    "discriminator/demonstration_score",
    "Discriminators on the clips",
    "",
    3,
    "their mean on the clips. The two meet where they cannot be told apart.",
)
_INJECTION = Metric(
    "ppo/injection",
    "Penalty on the injection",
    "",
    4,
    "beta times the length of what is added to the latents (eq. 12).",
)
TRAINING = (GOAL, IMITATION, EPISODE_LENGTH, FALL_RATE, _AGENT, _CLIPS, _INJECTION)
CURVES = (GOAL, IMITATION, EPISODE_LENGTH)
