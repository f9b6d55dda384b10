"""The suite: a sword-and-shield humanoid in MuJoCo behind gymnasium.

Importing it registers the ids; `gymnasium.make("murmillo.envs:murmillo/Imitation-v0")` does both in one go.
"""

from murmillo.envs import _opengl, _openmp  # noqa: F401  before anything that imports mujoco or torch
from murmillo.envs.config import EnvConfig
from murmillo.envs.errors import MotionError, SuiteError
from murmillo.envs.registration import register
from murmillo.envs.single import HumanoidEnv
from murmillo.envs.vector import HumanoidVectorEnv

register()

__all__ = ["EnvConfig", "HumanoidEnv", "HumanoidVectorEnv", "MotionError", "SuiteError"]
