"""Going to a place under a commanded skill (C·ASE eq. 7)."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from murmillo.envs.physics import State
from murmillo.envs.tasks.arguments import check_number, check_skill_steps
from murmillo.envs.tasks.location import Location, LocationConfig


@dataclass(frozen=True)
class RelocationConfig:
    """Arguments of `Relocation`.

    Attributes:
        radius: the target lies in the square of this half side about the root, as it is when the target is drawn [m].
        hold_steps: a target holds for a number of control steps between these two [1/30 s].
        skill_steps: control steps after which another skill is commanded at random; 0 keeps an episode's [1/30 s].
        alive: reward of every step beside the paper's, which is never above 0, so that an early fall can pay; with
            `radius`² and more it cannot.
    """

    radius: float = 10.0
    hold_steps: tuple[int, int] = (100, 200)
    skill_steps: int = 5
    alive: float = 0.0


class Relocation(Location):
    """Go to a place on the ground by the skill that is commanded; both change now and then.

    The paper's reward has no lower bound. Here the distance counts up to `radius` √2, the farthest that a target is
    placed: who runs away from there loses nothing more. Returns are normalised between that bound and being there.
    """

    config_type = RelocationConfig
    reward_doc = (
        "-0.5 min(d, D)² + alive, d the root's distance from the target on the ground, D = radius √2 the farthest that "
        "a target is placed (the paper has no bound)"
    )

    def __init__(self, config: RelocationConfig | None = None) -> None:
        """Raises SuiteError naming the argument that cannot be."""
        config = config or RelocationConfig()
        super().__init__(LocationConfig(config.radius, config.hold_steps))
        check_skill_steps(config.skill_steps)
        check_number("alive", config.alive, least=0.0)
        self.skill_steps, self._alive = int(config.skill_steps), config.alive
        self._farthest = math.sqrt(2.0) * config.radius
        self.reward_range = (config.alive - 0.5 * self._farthest**2, config.alive)

    def reward(self, state: State) -> dict[str, Tensor]:
        distance = self.to_target(state).norm(dim=-1).clamp_max(self._farthest)
        terms = {"position": -0.5 * distance.square().float()}
        if self._alive:
            terms["alive"] = torch.full_like(terms["position"], self._alive)
        return terms
