"""Which words of the command line are about AdaptNet, told without loading what it is made of."""

from collections.abc import Sequence

from murmillo.cli.tasks.words import choices_of, value_of

AGENT = "adaptnet"


def are_about_adaptnet(words: Sequence[str]) -> bool:
    """Whether `murmillo train` is to train AdaptNet: by `agent=`, by `stage=`, or as the run that it takes up again."""
    if (agent := value_of(words, "agent")) is not None:
        return agent == AGENT
    return value_of(words, "stage") is not None or is_adaptnet_run(value_of(words, "run.resume"))


def is_adaptnet_run(folder: str | None) -> bool:
    """Whether a run has trained AdaptNet; False where there is none, or none that can be read."""
    return choices_of(folder).get("agent") == AGENT
