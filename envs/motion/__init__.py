"""Motion clips: reading, storing and sampling them."""

from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.files import load_clips, save_clips
from murmillo.envs.motion.library import MotionLibrary

__all__ = ["Clip", "MotionLibrary", "load_clips", "save_clips"]
