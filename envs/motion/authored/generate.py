"""A take performed: the clip with its name, its maker and its licence."""

from murmillo.envs.character import Character
from murmillo.envs.motion.authored.body import Puppet
from murmillo.envs.motion.authored.cycle import Gait, stride
from murmillo.envs.motion.authored.floor import FloorTake, perform_on_floor
from murmillo.envs.motion.authored.take import Take, perform
from murmillo.envs.motion.authored.timing import FPS
from murmillo.envs.motion.clip import Clip, check_clip


def generate(take: Take | FloorTake | Gait, character: Character) -> Clip:
    """Solve a take for the character; the same take gives the same clip on the same machine."""
    if isinstance(take, Gait):
        qpos = stride(take, character)
    elif isinstance(take, FloorTake):
        qpos = perform_on_floor(take, character)
    else:
        qpos = perform(take, Puppet(character.model), character)
    clip = Clip(
        name=take.label, character=character.name, fps=FPS, qpos=qpos,
        label=take.label, source="murmillo authored", licence="CC0-1.0", redistributable=True, loop=take.loop,
    )  # fmt: skip
    return check_clip(clip, character)
