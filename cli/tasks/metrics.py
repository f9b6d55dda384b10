"""The scalars of a run that learns a task, as the progress display and the report show them."""

from murmillo.cli.metrics import FALL_RATE, RESIDUAL, STYLE, Metric

TASK = Metric(
    "reward/task",
    "Task reward",
    "",
    3,
    "the task's reward of a control step, mean over the worlds, with exploration noise on top. Up is good.",
)
SIMILARITY = Metric(
    "reward/similarity",
    "Similarity to the commanded style",
    "",
    3,
    "how near the chosen latent lies to an encoding of the commanded skill (CALM, eq. 8): 1 is on it. Up is good.",
)
_VALUE = Metric(
    "ppo/value",
    "Critic's loss",
    "",
    3,
    "squared error of the predicted return, in its variances: 1 is a critic that knows nothing. Down is good.",
)


def training_metrics(steps: int) -> tuple[Metric, ...]:
    """Those of a policy whose decisions take so many control steps."""
    unit = "steps" if steps == 1 else "decisions"
    took = "control steps (30 a second)" if steps == 1 else f"decisions of {steps} control steps (30 of these a second)"
    length = Metric(
        "episode/length",
        "Episode length",
        unit,
        0,
        f"{took} from a start to a fall, an end of the task's own or the clock.",
    )
    return (TASK, SIMILARITY, STYLE, RESIDUAL, length, FALL_RATE, _VALUE)
