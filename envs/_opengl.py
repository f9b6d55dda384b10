"""Imports MuJoCo with an OpenGL that can work on this machine.

MuJoCo chooses when it is imported, and only then; without a screen its own choice on Linux cannot draw. The variable is
taken back afterwards, so that other processes of the user choose for themselves.
"""

import os
import sys

HEADLESS = sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
"""No screen that a window could open on."""

_choose = HEADLESS and "MUJOCO_GL" not in os.environ

if _choose:
    os.environ["MUJOCO_GL"] = "egl"

import mujoco  # noqa: E402, F401

if _choose:
    del os.environ["MUJOCO_GL"]
