"""`murmillo record machine=…`: a film with the machine's state in the picture."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from murmillo.cli.machines.files import Chosen, choose
from murmillo.cli.machines.scene import MachineScene, MachineSettings


@dataclass
class MachineRecordConfig(MachineSettings):
    """What `murmillo record` takes for a machine; see `murmillo.cli.record.HELP`."""

    seconds: float | None = None
    camera: str = "track"
    out: str | None = None
    seed: int = 1
    threads: int = 1


def plan(words: list[str]) -> tuple[str, float, str, int, Callable[[Path, Path], Path]]:
    """What these words ask for: the run, the seconds, the file and the seed, and what films it."""
    settings, chosen = choose(MachineRecordConfig, words)
    seconds = chosen.file.seconds if settings.seconds is None else settings.seconds
    out = f"{chosen.variant}.mp4" if settings.out is None else settings.out
    return settings.run, seconds, out, settings.seed, lambda folder, path: film(settings, chosen, seconds, path)


def film(settings: MachineRecordConfig, chosen: Chosen, seconds: float, out: Path) -> Path:
    """Write the film of one world to `out`, whole or not at all, and return it.

    Raises:
        SuiteError: nothing can be drawn, or there is no such camera.
        AgentError, CommandError: a run or the machine cannot be used.
    """
    import imageio.v2 as imageio

    scene = MachineScene(settings, chosen, 1, chosen.file.seconds, render_mode="rgb_array", camera=settings.camera)
    beside = out.with_name(f".{out.stem}.part.mp4")
    try:
        env: Any = scene.world.env
        scene.reset(settings.seed)
        pictures = [env.render()[0]]
        scene.world.observe(lambda action, results: pictures.append(env.render()[0]))
        rate = env.metadata["render_fps"]
        missing = max(1, round(seconds * rate))
        writer: Any = imageio.get_writer(beside, fps=rate, macro_block_size=1)
        with writer:
            while missing > 0:
                state = scene.machine.states[int(scene.step()[0])]
                for picture in pictures[:missing]:
                    writer.append_data(_captioned(picture, state.name))
                missing -= len(pictures)
                pictures.clear()
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)
        scene.close()
    return out


def _captioned(picture: Any, text: str) -> Any:
    """The picture `[height, width, 3]` with a line of text in its corner."""
    import numpy as np
    from PIL import Image, ImageDraw

    image = Image.fromarray(picture)
    size = max(10, picture.shape[0] // 20)
    ImageDraw.Draw(image).text((size, size), text, fill="white", stroke_width=2, stroke_fill="black", font_size=size)
    return np.asarray(image)
