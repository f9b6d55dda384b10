"""The ways in which adversarial imitation is known to fail, and how a run's scalars show each.

At NaN the runner itself stops.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from murmillo.agents.common.numbers import check_at_least

WATCHED = {
    "agent_accuracy": "discriminator/agent_accuracy",
    "demonstration_accuracy": "discriminator/demonstration_accuracy",
    "skill": "reward/skill",
    "value": "ppo/value",
    "fall_rate": "episode/fall_rate",
    "length": "episode/length",
}
"""The scalars that are watched, under their names here; what an agent does not log is not judged."""


@dataclass
class WatchConfig:
    """What counts as a failure, and how long it must last until it is said; as long without it, and it is over.

    All is judged on slow means. Patience is counted in iterations, since learning goes by gradient steps. The defaults
    fit the 300 iterations of the smoke budget as well as the paper's 76,000; only the encoder's is longer than the
    smoke budget, in which an encoder learns next to nothing.

    Attributes:
        quiet: nothing is said before so many samples.
        memory: iterations that a slow mean looks back.
        accuracy: of the discriminator on the agent and on the clips, above which it has won.
        accuracy_iterations: patience with such a discriminator.
        skill_rise: of the skill reward above its lowest slow mean, below which the encoder has learnt nothing.
        skill_iterations: patience with such an encoder.
        value_loss: above which the critic may be diverging, in variances of the return: 1 is the loss of a critic that
            always predicts the mean.
        value_rise: times its lowest slow mean that the value loss must also be.
        value_iterations: patience with such a critic.
        fall_rate: of the episodes, above which all fall; that alone is how every run begins.
        length_rise: of the episodes, relative to their length after twice `memory` iterations, below which they get no
            longer. Before that the mean is of those episodes only that were short enough to end.
        fall_iterations: patience with falls that come no later.
    """

    quiet: int = 500_000
    memory: int = 20
    accuracy: float = 0.98
    accuracy_iterations: int = 50
    skill_rise: float = 0.02
    skill_iterations: int = 500
    value_loss: float = 1.0
    value_rise: float = 4.0
    value_iterations: int = 10
    fall_rate: float = 0.99
    length_rise: float = 0.02
    fall_iterations: int = 100

    def __post_init__(self) -> None:
        patience = ("accuracy_iterations", "skill_iterations", "value_iterations", "fall_iterations")
        check_at_least(1, self, "runner.watch", "memory", *patience)


@dataclass
class Trend:
    """What is remembered of a scalar.

    Attributes:
        count: values seen.
        slow: mean of all values at first, then over about the last `memory` ones.
        lowest: least slow mean so far.
        early: the slow mean after twice `memory` values; until then the present one.
    """

    count: int = 0
    slow: float = 0.0
    lowest: float = 0.0
    early: float = 0.0

    def add(self, value: float, memory: int) -> None:
        self.count += 1
        self.slow += (value - self.slow) / min(self.count, memory)
        self.lowest = self.slow if self.count == 1 else min(self.lowest, self.slow)
        if self.count <= 2 * memory:
            self.early = self.slow


Trends = Mapping[str, Trend]
"""What is remembered of each of `WATCHED`."""


@dataclass(frozen=True)
class Failure:
    """How a failure is found.

    Attributes:
        find: one line, what was seen, what it means and what to try; None while all is well.
        patience: iterations that it must last.
    """

    find: Callable[[Trends, WatchConfig], str | None]
    patience: Callable[[WatchConfig], int]


def _discriminator(trends: Trends, config: WatchConfig) -> str | None:
    agent, demonstration = trends["agent_accuracy"].slow, trends["demonstration_accuracy"].slow
    if min(agent, demonstration) <= config.accuracy:
        return None
    return (
        f"the discriminator has been right on {agent:.1%} of the agent's motions and {demonstration:.1%} of the "
        f"clips for {config.accuracy_iterations} iterations: it sees through all that the agent does, and its "
        "reward no longer says what would be better; try a lower agent.discriminator.learning_rate, fewer "
        "agent.discriminator.updates or a higher agent.discriminator.gradient_penalty"
    )


def _encoder(trends: Trends, config: WatchConfig) -> str | None:
    skill = trends["skill"]
    chance = max(skill.lowest, 0.0)  # what is below 0 is noise
    if not skill.count or skill.slow >= chance + config.skill_rise:
        return None
    return (
        f"the skill reward is {skill.slow:.3f} and has not risen for {config.skill_iterations} iterations: "
        "the encoder cannot tell from a motion which latent it was made under, so no latent stands for a skill; "
        "try a higher runner.reward_weights.skill or agent.diversity_weight, or more agent.discriminator.updates, "
        "which are the encoder's too"
    )


def _value(trends: Trends, config: WatchConfig) -> str | None:
    value = trends["value"]
    if value.slow <= config.value_loss or value.slow <= config.value_rise * value.lowest:
        return None
    return (
        f"the value loss has risen from {value.lowest:.2f} to {value.slow:.2f} (always predicting the mean return "
        "gives 1): the critic is diverging, and the advantages are noise; try a lower "
        "agent.ppo.value_learning_rate, fewer agent.ppo.epochs or a lower agent.ppo.policy_learning_rate"
    )


def _falls(trends: Trends, config: WatchConfig) -> str | None:
    fall_rate, length = trends["fall_rate"].slow, trends["length"]
    if fall_rate <= config.fall_rate or length.slow > (1 + config.length_rise) * length.early:
        return None
    return (
        f"{fall_rate:.0%} of the episodes end in a fall, after {length.slow:.1f} steps ({length.early:.1f} early "
        "on): the policy does not learn to stay on its feet; try agent.ppo.target_kl=0.15 or a lower "
        "agent.ppo.policy_learning_rate, or an easier beginning by warm_start.steps=1000 and "
        "env.starts.reference=0.9"
    )


FAILURES = {
    "discriminator": Failure(_discriminator, lambda config: config.accuracy_iterations),
    "encoder": Failure(_encoder, lambda config: config.skill_iterations),
    "value": Failure(_value, lambda config: config.value_iterations),
    "falls": Failure(_falls, lambda config: config.fall_iterations),
}
