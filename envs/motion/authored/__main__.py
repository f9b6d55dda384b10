"""Makes the built-in clips, measures them and draws them:

python -m murmillo.envs.motion.authored [--character NAME] [--out FOLDER] [--sheet FOLDER]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

from murmillo.envs.character import load_character
from murmillo.envs.errors import SuiteError
from murmillo.envs.motion import Clip, save_clips
from murmillo.envs.motion.authored.generate import generate
from murmillo.envs.motion.authored.skills import SKILLS
from murmillo.envs.motion.authored.styles import GAITS
from murmillo.envs.motion.measures import Measures, measure
from murmillo.envs.motion.preview import contact_sheet

SHIPPED = Path(__file__).resolve().parents[3] / "assets" / "motions"
PACKS = {"sword_shield": SKILLS, "humanoid": GAITS}
COLUMNS = ("s", "slide", "lowest", "limits", "speed", "jump", "tracked", "closure")
UNITS = "slide [cm a frame], lowest [cm], limits [rad], speed and jump [rad/s], tracked [%], closure [rad]"


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the packs; the clips of each are written together, once all of them are made."""
    parser = argparse.ArgumentParser("python -m murmillo.envs.motion.authored", description="Make the built-in clips.")
    parser.add_argument("--character", choices=("all", *PACKS), default="all", help="whose clips (default: all)")
    parser.add_argument(
        "--out", type=Path, default=SHIPPED, help="holds a folder a character (default: the shipped one)"
    )
    parser.add_argument("--sheet", type=Path, help="likewise for a contact sheet of each clip (PNG)")
    options = parser.parse_args(arguments)
    for name in PACKS if options.character == "all" else (options.character,):
        _make_pack(name, options.out / name, options.sheet and options.sheet / name)


def _make_pack(name: str, folder: Path, sheets: Path | None) -> None:
    character, clips = load_character(name), []
    table = Table(title=escape(UNITS), box=None)
    for column in (name, *COLUMNS):
        table.add_column(column, justify="left" if column == name else "right", no_wrap=True)
    for skill in track(PACKS[name], name):
        clip = generate(skill(), character)
        clips.append(clip)
        table.add_row(*_row(clip, measure(clip, character)))
        if sheets:
            contact_sheet(clip, character, sheets / f"{clip.name}.png")
    save_clips(folder, clips)
    console = Console()
    console.print(table)
    console.print(f"{len(clips)} clips, {sum(clip.duration for clip in clips):.1f} s, written to {folder}")


def _row(clip: Clip, m: Measures) -> list[str]:
    values = (clip.duration, 100 * m.slide, 100 * m.lowest, m.beyond_limits, m.speed, m.jump, 100 * m.tracked)
    return [clip.name, *(f"{value:.2f}" for value in (*values, m.closure))]


if __name__ == "__main__":
    try:
        main()
    except SuiteError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
