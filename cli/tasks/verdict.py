"""Whether a policy does more for its task than what it is compared with, in a sentence, and why where it does not."""

from typing import Any

from murmillo.cli.tasks.players import RANDOM, TRAINED, UNTRAINED

LEARNED = 0.2
"""Of the range from the least to the most return: what a policy gains that has learned its task."""
_BESIDE = {UNTRAINED: "what it was before training", RANDOM: "that of random latents"}


def verdict(results: dict[str, Any], episode_steps: int) -> str:
    """The sentence, by the figures of an evaluation; empty where there are no returns to compare.

    Args:
        results: as `evaluation/metrics.json` has them.
        episode_steps: of a whole episode.
    """
    figures = results["metrics"]["task"]["figures"]

    def value(name: str, player: str) -> float | None:
        return figures.get(name, {}).get("values", {}).get(player, {}).get("value")

    other = UNTRAINED if value("normalised_return", RANDOM) is None else RANDOM
    after, before = value("normalised_return", TRAINED), value("normalised_return", other)
    if after is None or before is None:
        return ""
    gain = f"the return is {after - before:+.3f} of its range beside {_BESIDE[other]}"
    if after - before >= LEARNED:
        return f"**The task is learned**: {gain}."
    unlearned = f"**The task is not learned yet**: {gain}, where {LEARNED} would count."
    ended, length = value("early_rate", TRAINED), value("length", TRAINED)
    if ended is None or length is None or ended < 0.5:
        return f"{unlearned} Train it on."
    cure = "train the policy below until it stays up" if other == RANDOM else "train it on"
    return (
        f"{unlearned} {ended:.0%} of the episodes end early, after {length:.0f} of {episode_steps} steps on average, "
        f"which leaves {length / episode_steps:.2f} of the range within reach: {cure}."
    )
