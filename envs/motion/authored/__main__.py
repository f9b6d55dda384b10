"""Makes the built-in clips, measures them and draws them:

python -m murmillo.envs.motion.authored [--out FOLDER] [--sheet FOLDER]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from murmillo.envs.character import load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion import Clip, save_clips
from murmillo.envs.motion.authored.generate import generate
from murmillo.envs.motion.authored.sheet import draw
from murmillo.envs.motion.authored.skills import SKILLS
from murmillo.envs.motion.measures import Measures, measure

SHIPPED = Path(__file__).resolve().parents[3] / "assets" / "motions" / "sword_shield"
COLUMNS = ("s", "slide", "lowest", "limits", "speed", "jump", "tracked", "closure")
UNITS = "slide [cm a frame], lowest [cm], limits [rad], speed and jump [rad/s], tracked [%], closure [rad]"


def main(arguments: Sequence[str] | None = None) -> None:
    """Make every skill; the clips are written together at the end."""
    parser = argparse.ArgumentParser("python -m murmillo.envs.motion.authored", description="Make the built-in clips.")
    parser.add_argument("--out", type=Path, default=SHIPPED, help="folder of the clips (default: the shipped one)")
    parser.add_argument("--sheet", type=Path, help="folder for a contact sheet of each clip (PNG)")
    options = parser.parse_args(arguments)

    character = load_character("sword_shield")
    table = Table(title=UNITS)
    for column in ("clip", *COLUMNS):
        table.add_column(column, justify="left" if column == "clip" else "right")
    clips = []
    for skill in SKILLS:
        clip = generate(skill(), character)
        clips.append(clip)
        table.add_row(*_row(clip, measure(clip, character)))
        if options.sheet:
            draw(clip, character, options.sheet / f"{clip.name}.png")
    save_clips(options.out, clips)
    console = Console()
    console.print(table)
    console.print(f"{len(clips)} clips, {sum(clip.duration for clip in clips):.1f} s, written to {options.out}")


def _row(clip: Clip, m: Measures) -> list[str]:
    values = (clip.duration, 100 * m.slide, 100 * m.lowest, m.beyond_limits, m.speed, m.jump, 100 * m.tracked)
    return [clip.name, *(f"{value:.2f}" for value in (*values, m.closure))]


if __name__ == "__main__":
    try:
        main()
    except SuiteError as error:
        sys.exit(str(error))
