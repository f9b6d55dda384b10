"""A finite-state machine that does a task by telling an agent which motion to follow (CALM, section 6.2)."""

from dataclasses import dataclass

from murmillo.agents.calm.machine.condition import Condition

OWN_QUANTITIES = {
    "time": "since the attempt began [s]",
    "time_in_state": "since the state was entered [s]",
}
"""What every machine can ask for beside the quantities of its task."""


@dataclass(frozen=True)
class Clip:
    """Follow a motion: the low-level policy is given the encoding of the middle of a clip.

    Attributes:
        name: of the clip.
    """

    name: str


@dataclass(frozen=True)
class Heading:
    """Go somewhere in a style: a policy that was trained for it chooses the latents (CALM, section 6.1).

    Attributes:
        towards: a place of the task.
        style: a skill that the policy can be told.
        speed: to go at [m/s].
    """

    towards: str
    style: str
    speed: float


@dataclass(frozen=True)
class Transition:
    """A way out of a state.

    Attributes:
        target: index of the state that comes next.
        condition: when.
    """

    target: int
    condition: Condition


@dataclass(frozen=True)
class State:
    """What to do, and until when.

    Attributes:
        name: in the log and in pictures.
        command: what the agent is told.
        transitions: asked in this order; none stay for ever.
    """

    name: str
    command: Clip | Heading
    transitions: tuple[Transition, ...]


@dataclass(frozen=True)
class Machine:
    """States, and what they are for.

    Attributes:
        states: all of them.
        start: index of the first.
        success: when the task is done; None where the machine does not say.
    """

    states: tuple[State, ...]
    start: int
    success: Condition | None


@dataclass(frozen=True)
class Vocabulary:
    """The names that a machine may use.

    Attributes:
        quantities: of the task.
        places: of the task.
        clips: that the agent can encode.
        styles: that the policy of headings can be told.
    """

    quantities: tuple[str, ...]
    places: tuple[str, ...]
    clips: tuple[str, ...]
    styles: tuple[str, ...]
