"""Which words of the command line are about AdaptNet, told without loading what it is made of."""

from collections.abc import Sequence

from murmillo.cli.tasks.words import choices_of, value_of

AGENT = "adaptnet"


def are_about_adaptnet(words: Sequence[str]) -> bool:
    """Whether `murmillo train` is to train AdaptNet: by `agent=`, by `stage=`, or as a run that it is told of."""
    if (agent := value_of(words, "agent")) is not None:
        return agent == AGENT
    named = (value_of(words, name) for name in ("run.resume", "base"))
    return value_of(words, "stage") is not None or any(map(is_adaptnet_run, named))


def adapt_skills(words: Sequence[str]) -> bool:
    """Whether `murmillo train` is to adapt a policy of ASE, CALM or C·ASE; AdaptNet's own words are asked first."""
    new = value_of(words, "run.resume") in (None, "null", "")
    return new and any(value_of(words, name) is not None for name in ("base", "to"))


def is_adaptnet_run(folder: str | None) -> bool:
    """Whether a run has trained AdaptNet; False where there is none, or none that can be read."""
    return choices_of(folder).get("agent") == AGENT
