"""Retargeting of recordings to a character; needs the packages of the extra `motion`."""

from importlib.util import find_spec

from murmillo.envs.errors import MotionError

if any(find_spec(package) is None for package in ("mink", "daqp", "scipy")):
    raise MotionError("retargeting: needs mink, daqp and scipy; pip install murmillo[motion]")

from murmillo.envs.motion.retarget.fit import Faults, Fit
from murmillo.envs.motion.retarget.retargeting import retarget
from murmillo.envs.motion.retarget.skeleton_map import SkeletonMap, load_map, shipped_maps

__all__ = ["Faults", "Fit", "SkeletonMap", "load_map", "retarget", "shipped_maps"]
