"""The pose and the footholds that skills begin and end in, so that they compose."""

from murmillo.envs.motion.authored.body import Pose
from murmillo.envs.motion.authored.take import STANCE

GUARD = Pose()
LEFT, RIGHT = STANCE["left"], STANCE["right"]
FLAT = {"left": (LEFT.yaw, 0.0), "right": (RIGHT.yaw, 0.0)}  # yaw and pitch of the soles [deg]
