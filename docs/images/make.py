"""Draws the pictures of the README from the built-in clips: `MUJOCO_GL=egl python docs/images/make.py`."""

from pathlib import Path

import imageio.v3 as iio
import numpy as np

from murmillo.envs.character import load_character
from murmillo.envs.motion import load_clips
from murmillo.envs.rendering import FrameRenderer

MOMENTS = {"guard": 0.2, "slash_up": 0.33, "spin_attack": 0.36, "kick": 0.40, "jump": 0.46}
"""Clip and the part of it that has gone by."""

character = load_character()
clips = {clip.name: clip for clip in load_clips("builtin", character)}
renderer = FrameRenderer(character, 360, 480, "track")
frames = [renderer.frame(clips[name].qpos[int(part * (clips[name].frames - 1))]) for name, part in MOMENTS.items()]
iio.imwrite(Path(__file__).with_name("murmillo.png"), np.concatenate(frames, axis=1))
