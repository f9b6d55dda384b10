"""Moving and facing as a user directs, by the skill that is commanded (C·ASE eq. 6)."""

from dataclasses import dataclass

from murmillo.envs.tasks.arguments import check_skill_steps
from murmillo.envs.tasks.steering import Steering, SteeringConfig


@dataclass(frozen=True)
class DirectionConfig:
    """Arguments of `Direction`.

    Attributes:
        speed: least and greatest target speed [m/s].
        hold_steps: directions and a speed hold for a number of control steps between these two [1/30 s].
        skill_steps: control steps after which another skill is commanded at random; 0 keeps an episode's [1/30 s].
    """

    speed: tuple[float, float] = (0.0, 5.0)
    hold_steps: tuple[int, int] = (100, 200)
    skill_steps: int = 5


class Direction(Steering):
    """`Steering` under a commanded skill: its reward, other speeds, and a skill that changes every few steps.

    The paper observes no target speed, although it varies; here it is part of the goal.
    """

    config_type = DirectionConfig

    def __init__(self, config: DirectionConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        config = config or DirectionConfig()
        super().__init__(SteeringConfig(config.speed, config.hold_steps))
        check_skill_steps(config.skill_steps)
        self.skill_steps = int(config.skill_steps)
