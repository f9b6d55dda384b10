"""A leg solved in closed form: where the hip and the foot are says how the three joints stand."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation


class Leg:
    """The lengths of one leg of a character, "left" or "right"; its thigh and shin hang straight down in the zero pose.

    Attributes:
        hip: [3] of the hip joint in the pelvis frame [m].
        thigh, shin: lengths [m].
    """

    def __init__(self, model: mujoco.MjModel, side: str) -> None:
        self.hip = model.body(f"{side}_thigh").pos.copy()
        self.thigh = float(-model.body(f"{side}_shin").pos[2])
        self.shin = float(-model.body(f"{side}_foot").pos[2])

    def reach(self, knee: float) -> float:
        """Distance from hip to ankle at a knee flexion [deg], [m]."""
        return float(np.sqrt(self.thigh**2 + self.shin**2 + 2.0 * self.thigh * self.shin * np.cos(np.radians(knee))))

    def hang(self, lean: np.ndarray, knee: np.ndarray) -> np.ndarray:
        """Ankle from the hip [F, 2] (ahead, up) [m] of a thigh that leans ahead and a knee that is bent [F] [deg]."""
        return hanging(self.thigh, self.shin, lean, knee)

    def solve(
        self, pelvis: Rotation, hip_w: np.ndarray, ankle_w: np.ndarray, foot: Rotation, knee_yaw: np.ndarray
    ) -> tuple[Rotation, np.ndarray, Rotation]:
        """Hip rotations, knee flexions [F] [rad] and ankle rotations that put the foot where it is asked.

        Args:
            pelvis, foot: F rotations in the world.
            hip_w, ankle_w: [F, 3] [m].
            knee_yaw: [F] heading that the knee bends to [deg].
        """
        line = ankle_w - hip_w
        distance = np.linalg.norm(line, axis=-1)
        cosine = (distance**2 - self.thigh**2 - self.shin**2) / (2.0 * self.thigh * self.shin)
        knee = np.arccos(np.clip(cosine, -1.0, 1.0))
        zero = np.zeros_like(knee)
        ankle = np.stack([-self.shin * np.sin(knee), zero, -self.thigh - self.shin * np.cos(knee)], axis=-1)
        left = Rotation.from_euler("z", knee_yaw[:, None], degrees=True).apply([0.0, 1.0, 0.0])
        local = _frame(ankle, np.broadcast_to([0.0, 1.0, 0.0], ankle.shape))
        thigh = _frame(line, left) * local.inv()
        shin = thigh * Rotation.from_euler("y", knee[:, None])
        return pelvis.inv() * thigh, knee, shin.inv() * foot


def hanging(thigh: float, shin: float, lean: np.ndarray | float, knee: np.ndarray | float) -> np.ndarray:
    """Ankle from the hip [..., 2] (ahead, up) of a thigh and a shin of these lengths [m].

    Args:
        lean: of the thigh, ahead of the vertical [...] [deg].
        knee: how far it is bent [...] [deg].
    """
    upper, lower = np.radians(lean), np.radians(lean - knee)
    ahead = thigh * np.sin(upper) + shin * np.sin(lower)
    up = -thigh * np.cos(upper) - shin * np.cos(lower)
    return np.stack([ahead, up], axis=-1)


def _frame(first: np.ndarray, second: np.ndarray) -> Rotation:
    """Rotations whose first axis lies along `first` [F, 3] and whose second is as near to `second` [F, 3] as can be."""
    x = first / np.linalg.norm(first, axis=-1, keepdims=True)
    y = second - np.sum(second * x, axis=-1, keepdims=True) * x
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    return Rotation.from_matrix(np.stack([x, y, np.cross(x, y)], axis=-1))
