"""Block: catch flying cubes with the shield (CALM, appendix A)."""

from dataclasses import dataclass
from typing import Any

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import State
from murmillo.envs.scene import add_box
from murmillo.envs.tasks.arguments import check_number, check_range
from murmillo.envs.tasks.goals import into_heading, uniform
from murmillo.envs.tasks.interface import Task
from murmillo.envs.tasks.props import aimed, around, felt, put, seen

AIMS = ("right_hand", "left_hand", "torso", "pelvis", "head")


@dataclass
class BlockConfig:
    """Arguments of `Block`.

    Attributes:
        distance: range of the distances that cubes fly from [m].
        height: range of the heights that they fly from [m].
        speed: range of their speeds [m/s].
        cycle: control steps from one cube to the next.
        warm_up: of these, the steps before it flies.
        drift: distance from where the episode began that ends it [m].
        touch: least force that is a hit, along any axis [N].
    """

    distance: tuple[float, float] = (1.5, 3.0)
    height: tuple[float, float] = (0.25, 2.0)
    speed: tuple[float, float] = (30.0, 40.0)
    cycle: int = 70
    warm_up: int = 40
    drift: float = 2.0
    touch: float = 1.0

    def __post_init__(self) -> None:
        for name in ("distance", "height", "speed"):
            check_range(name, getattr(self, name), least=0.0)
        check_number("drift", self.drift, above=0.0)
        check_number("touch", self.touch, least=0.0)
        if not 0 < self.warm_up < self.cycle:
            raise SuiteError(f"task.warm_up={self.warm_up}: needs 0 < warm_up < cycle={self.cycle}")


class Block(Task):
    """A cube of 0.2 m and 0.8 kg is thrown every 70 steps at a hand, the trunk or the head.

    During the warm-up it hangs in the air where it will come from.
    """

    config_type = BlockConfig
    goal_dim = 18
    goal_doc = (
        "part of the cycle that is over (1), where the episode began [m] (2), cube: place from the root [m] (3), "
        "rotation (6), velocity [m/s] (3), spin [rad/s] (3), heading frame"
    )
    reward_doc = "1 in every step since the last cube hit the shield and nothing else"
    end_doc = "fall, clock, a hit on another body than the shield, a drift of more than 2 m"

    def __init__(self, config: BlockConfig | None = None) -> None:
        self.config = config or BlockConfig()

    def edit(self, spec: mujoco.MjSpec) -> None:
        add_box(spec, "cube", (0.2, 0.2, 0.2), 0.8, margin=0.1)

    def bind(self, num_envs: int, character: Character) -> None:
        super().bind(num_envs, character)
        shield = character.bodies.index("shield")
        self._shield = torch.tensor([shield])
        self._others = torch.tensor([i for i in range(len(character.bodies)) if i != shield])
        self._aims = torch.tensor(character.body_ids(AIMS))
        self._clock = torch.zeros(num_envs, dtype=torch.int64)
        self._blocked = torch.zeros(num_envs, dtype=torch.bool)
        self._origin_w = torch.zeros(num_envs, 2, dtype=torch.float64)
        self._waiting_w = torch.zeros(num_envs, 3, dtype=torch.float64)

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        self._origin_w[env_ids] = state.qpos[env_ids, :2].double()
        self._begin_cycle(env_ids, state, generator)

    def advance(self, state: State, generator: torch.Generator) -> None:
        self._blocked |= self._hit(state, self._shield)
        self._clock += 1
        ended = (self._clock >= self.config.cycle).nonzero().squeeze(-1)
        if len(ended):
            self._begin_cycle(ended, state, generator)
        waiting = (self._clock < self.config.warm_up).nonzero().squeeze(-1)
        put(state, waiting, 0, self._waiting_w[waiting])
        thrown = (self._clock == self.config.warm_up).nonzero().squeeze(-1)
        if len(thrown):
            self._throw(thrown, state, generator)

    def _begin_cycle(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        n, config = len(env_ids), self.config
        distance, height = uniform(n, config.distance, generator), uniform(n, config.height, generator)
        self._waiting_w[env_ids, :2] = around(state.qpos[env_ids], distance, generator)
        self._waiting_w[env_ids, 2] = height
        self._clock[env_ids] = 0
        self._blocked[env_ids] = False
        put(state, env_ids, 0, self._waiting_w[env_ids])

    def _throw(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        aim = self._aims[torch.randint(len(self._aims), (len(env_ids),), generator=generator)]
        start_w, target_w = state.prop_qpos[env_ids, 0, :3], state.body_pos_w[env_ids, aim]
        velocity_w = aimed(start_w, target_w, self.config.speed, generator)
        state.prop_qvel[env_ids, 0, :3] = velocity_w.to(state.prop_qvel)

    def goal(self, state: State) -> Tensor:
        phase = (self._clock.double() / self.config.cycle).unsqueeze(-1)
        home = into_heading(state, self._origin_w - state.qpos[:, :2])
        return torch.cat((phase, home, seen(state, 0)), dim=-1).float()

    def reward(self, state: State) -> dict[str, Tensor]:
        shielded = self._blocked | self._hit(state, self._shield)
        return {"block": (shielded & ~self._hit(state, self._others)).float()}

    def terminated(self, state: State) -> Tensor:
        drift = (state.qpos[:, :2] - self._origin_w).norm(dim=-1)
        return self._hit(state, self._others) | (drift > self.config.drift)

    def state_dict(self) -> dict[str, Any]:
        return {name: getattr(self, f"_{name}").clone() for name in ("clock", "blocked", "origin_w", "waiting_w")}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            getattr(self, f"_{name}").copy_(value)

    def _hit(self, state: State, bodies: Tensor) -> Tensor:
        return felt(state, 0, bodies, self.config.touch)
