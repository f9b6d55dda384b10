"""The skills, each a short score of key poses and steps; most begin and end in guard, so that they compose."""

from collections.abc import Callable

from murmillo.envs.motion.authored.skills import locomotion, shield, stances, sword, unarmed
from murmillo.envs.motion.authored.take import Take

SKILLS: tuple[Callable[[], Take], ...] = (
    stances.guard,
    stances.idle,
    locomotion.walk_forward,
    locomotion.step_back,
    locomotion.turn_left_90,
    locomotion.turn_right_90,
    sword.slash_down,
    sword.slash_left,
    sword.slash_right,
    sword.stab,
    shield.shield_bash,
    unarmed.kick,
    shield.block_high,
)
