"""The suite: a sword-and-shield humanoid in MuJoCo behind gymnasium.

Importing it registers the ids; `gymnasium.make("murmillo.envs:murmillo/Imitation-v0")` does both in one go.
"""

import os
import sys

if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    # mujoco chooses its OpenGL when it is imported, and without a screen its own choice cannot work
    os.environ.setdefault("MUJOCO_GL", "egl")

from murmillo.envs.errors import MotionError, SuiteError
from murmillo.envs.registration import register
from murmillo.envs.single import HumanoidEnv
from murmillo.envs.vector import EnvConfig, HumanoidVectorEnv

register()

__all__ = ["EnvConfig", "HumanoidEnv", "HumanoidVectorEnv", "MotionError", "SuiteError"]
