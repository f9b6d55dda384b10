"""Strike: walk to a standing block and knock it over with the sword (ASE, section 7.2; CALM, section 6.2)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.devices import Placed
from murmillo.envs.markers import Marker
from murmillo.envs.physics import State
from murmillo.envs.rotations import quat_rotate
from murmillo.envs.scene import add_box
from murmillo.envs.tasks.arguments import check_choice, check_number, check_range
from murmillo.envs.tasks.goals import TARGET_DOCS, towards_target, uniform
from murmillo.envs.tasks.interface import Task
from murmillo.envs.tasks.props import around, felt, put, seen

SIZE = (0.4, 0.4, 1.8)
MASS = 8.6
_UP = Placed(torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))


@dataclass
class StrikeConfig:
    """Arguments of `Strike`.

    Attributes:
        near: share of the targets that stand near.
        near_distance, far_distance: ranges of their distances from the root [m].
        touch: least force that is a touch, along any axis [N].
        any_body: other bodies than the sword may touch the target too, so that a kick is no failure.
        form: "paper" rewards the target's tilt alone, and only the sword may touch it; "code", as released, rewards the
            approach too, counts a target tilted by more than 78 degrees as full, and lets the arm of the sword touch.
    """

    near: float = 0.5
    near_distance: tuple[float, float] = (0.5, 1.5)
    far_distance: tuple[float, float] = (0.5, 10.0)
    touch: float = 1.0
    any_body: bool = False
    form: Literal["paper", "code"] = "paper"

    def __post_init__(self) -> None:
        check_number("near", self.near, least=0.0)
        check_range("near_distance", self.near_distance, least=0.0)
        check_range("far_distance", self.far_distance, least=0.0)
        check_number("touch", self.touch, least=0.0)
        check_choice("form", self.form, ("paper", "code"))


class Strike(Task):
    """A block of 0.4 x 0.4 x 1.8 m and 8.6 kg stands somewhere around; nothing but the sword may touch it."""

    config_type = StrikeConfig
    goal_dim = 15
    goal_doc = (
        "target: place from the root, its height from the ground [m] (3), rotation (6), velocity [m/s] (3), "
        "spin [rad/s] (3), heading frame"
    )
    reward_doc = "1 - u_target . up; code: 0.6 max(0, 1 - u . up) + 0.4 exp(-4 max(0, 1 - v_d)^2), 1 once u . up < 0.2"
    end_doc = "fall, clock, a touch of the target by a body that is neither the sword nor a foot"
    quantity_docs: ClassVar[Mapping[str, str]] = {
        **Task.quantity_docs,
        **TARGET_DOCS,
        "target_tilt": "angle between the target's own up and the world's [rad]",
        "target_speed": "of the target's centre [m/s]",
    }
    place_docs: ClassVar[Mapping[str, str]] = {"target": "below the target's centre"}

    def __init__(self, config: StrikeConfig | None = None) -> None:
        self.config = config or StrikeConfig()

    def edit(self, spec: mujoco.MjSpec) -> None:
        add_box(spec, "target", SIZE, MASS)

    def bind(self, num_envs: int, character: Character) -> None:
        super().bind(num_envs, character)
        arm = ("right_hand", "right_lower_arm") if self.config.form == "code" else ()
        may = character.bodies if self.config.any_body else ("sword", *arm, *character.feet)
        self._forbidden = torch.tensor(
            [i for i, body in enumerate(character.bodies) if body not in may], dtype=torch.int64
        )

    def reset(self, env_ids: Tensor, state: State, generator: torch.Generator) -> None:
        n, config = len(env_ids), self.config
        near, far = (uniform(n, bounds, generator) for bounds in (config.near_distance, config.far_distance))
        is_near = torch.rand(n, generator=generator) < config.near
        place = around(state.qpos[env_ids], torch.where(is_near, near, far), generator)
        turn = uniform(n, (0.0, torch.pi), generator)
        quat_w = torch.stack((turn.cos(), 0.0 * turn, 0.0 * turn, turn.sin()), dim=-1)
        put(state, env_ids, 0, torch.nn.functional.pad(place, (0, 1), value=0.5 * SIZE[2]), quat_w)

    def goal(self, state: State) -> Tensor:
        goal = seen(state, 0)
        goal[:, 2] = state.prop_qpos[:, 0, 2]
        return goal.float()

    def reward(self, state: State) -> dict[str, Tensor]:
        upright = self._upright(state)
        if self.config.form == "paper":
            return {"tilt": (1.0 - upright).clamp(0.0, 1.0)}
        to_target = state.prop_qpos[:, 0, :2] - state.qpos[:, :2]
        speed = (state.qvel[:, :2] * torch.nn.functional.normalize(to_target, dim=-1)).sum(-1)
        down = upright < 0.2
        tilt = torch.where(down, 0.6, 0.6 * (1.0 - upright).clamp_min(0.0))
        approach = torch.where(down, 0.4, 0.4 * torch.exp(-4.0 * (1.0 - speed).clamp_min(0.0).square()))
        return {"tilt": tilt, "approach": approach}

    def terminated(self, state: State) -> Tensor:
        return felt(state, 0, self._forbidden, self.config.touch)

    def quantities(self, state: State) -> dict[str, Tensor]:
        return {
            **super().quantities(state),
            **towards_target(state, state.prop_qpos[:, 0, :2]),
            "target_tilt": self._upright(state).clamp(-1.0, 1.0).acos(),
            "target_speed": state.prop_qvel[:, 0, :3].norm(dim=-1),
        }

    def places(self, state: State) -> dict[str, Tensor]:
        return {"target": state.prop_qpos[:, 0, :2].clone()}

    def markers(self, state: State, world: int) -> list[Marker]:
        x, y, _ = state.prop_qpos[world, 0, :3].tolist()
        return [Marker((x, y, SIZE[2] + 0.3), size=0.08)]

    def _upright(self, state: State) -> Tensor:
        """[N] cosine between the target's own up and the world's."""
        return quat_rotate(state.prop_qpos[:, 0, 3:7], _UP.like(state.prop_qpos).expand(self.num_envs, 3))[:, 2]
