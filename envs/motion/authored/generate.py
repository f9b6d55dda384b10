"""A take performed: the clip with its name, its maker and its licence."""

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.body import Puppet
from murmillo.envs.motion.authored.take import Take, perform
from murmillo.envs.motion.authored.timing import FPS
from murmillo.envs.motion.clip import Clip, check_clip


def generate(take: Take, character: Character) -> Clip:
    """Solve a take for the character; the same take gives the same clip on the same machine."""
    clip = Clip(
        name=take.label, character=character.name, fps=FPS, qpos=perform(take, Puppet(character.model), character),
        label=take.label, source="murmillo authored", licence="CC0-1.0", redistributable=True, loop=take.loop,
    )  # fmt: skip
    return check_clip(clip, character)
