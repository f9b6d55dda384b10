"""When an episode ends by a fall."""

from dataclasses import dataclass, field
from typing import Literal

import mujoco
import torch
from torch import Tensor

from murmillo.envs.character import Character
from murmillo.envs.errors import SuiteError
from murmillo.envs.physics import State


@dataclass
class FallConfig:
    """A fall: a body other than the feet is touched, and a body other than the feet is low (published code of ASE).

    Attributes:
        contact: "ground" counts the ground's touch only (the paper's words); "any" counts touches of the character's
            own bodies too, as the published code's net contact forces do.
        force: least force that is a touch, per axis [N].
        height: a body whose origin is below is low [m].
        heights: exceptions to `height` by body [m]; the left forearm's allows for the shield.
        same_body: whether the touched body must itself be the low one (published code of AdaptNet).
    """

    contact: Literal["ground", "any"] = "ground"
    force: float = 0.1
    height: float = 0.15
    heights: dict[str, float] = field(default_factory=lambda: {"head": 0.30, "left_lower_arm": 0.32})
    same_body: bool = False


class FallDetector:
    """`FallConfig` on the bodies of one character."""

    def __init__(self, character: Character, config: FallConfig) -> None:
        for body in config.heights:
            if body not in character.bodies:
                raise SuiteError(f"fall.heights.{body}: no such body; there are: {', '.join(character.bodies)}")
        falling = tuple(body for body in character.bodies if body not in character.feet)
        self._bodies = torch.tensor(character.body_ids(falling), dtype=torch.int64)
        self._low = torch.tensor([config.heights.get(body, config.height) for body in falling], dtype=torch.float64)
        self._force, self._same_body = config.force, config.same_body
        self.touch_is_fall = False
        """Whether a touch alone is a fall, however high the bodies are."""

    def __call__(self, state: State, ground: Tensor | None = None) -> Tensor:
        """[N] bool: these worlds lie on the ground. Unless `same_body`, the touched body and the low one may be two.

        Bodies are low by their heights above the ground's under the root, ground [N] [m]; None is level at 0.
        """
        touched = (state.ground_force_w[:, self._bodies].abs() > self._force).any(-1)
        if self.touch_is_fall:
            return touched.any(-1)
        height = state.body_pos_w[:, self._bodies, 2]
        low = (height if ground is None else height - ground.unsqueeze(-1)) < self._low
        return (touched & low).any(-1) if self._same_body else touched.any(-1) & low.any(-1)


def count_every_contact(spec: mujoco.MjSpec) -> None:
    """Edit for `contact="any"`: the ground sensors then hold the net force of all that touches the body."""
    for sensor in spec.sensors:
        if sensor.name.startswith("ground_"):
            sensor.objtype, sensor.objname = sensor.reftype, sensor.refname
            sensor.reftype, sensor.refname = mujoco.mjtObj.mjOBJ_UNKNOWN, ""
