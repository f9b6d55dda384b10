"""`murmillo record` of a run of AdaptNet, with as much of its adaptation as is asked for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from murmillo.cli.blending import Blend, renamed


@dataclass
class AdaptNetRecordConfig:
    """What `murmillo record` takes for such a run; see `murmillo.cli.record.HELP`."""

    run: str
    alpha: float | None = None
    other: str | None = None
    seconds: float = 10.0
    camera: str = "track"
    out: str = "video.mp4"
    seed: int = 1
    base: str | None = None
    motions: str | None = None


def parse(words: list[str]) -> AdaptNetRecordConfig:
    """The settings of words name=value, where `with` is the other run.

    Raises:
        CommandError: a word that cannot be, in one line with what would be right.
    """
    from murmillo.cli import config as configuration

    settings = configuration.parse(AdaptNetRecordConfig, renamed(words))
    Blend(settings.alpha, settings.other)  # a mistake shows before the run is read
    return settings


def film(folder: Path, settings: AdaptNetRecordConfig, out: Path) -> Path:
    """Write the film of one world to `out`, whole or not at all, and return it.

    Raises:
        SuiteError: nothing can be drawn, or there is no such camera.
        AgentError: the checkpoint is missing or does not fit.
        CommandError: the base is missing or has changed, or the adapters cannot act as is asked.
    """
    import imageio.v2 as imageio

    from murmillo.agents.common.rollout import tensors
    from murmillo.cli.adaptation.world import load_blended, make_env, open_run

    config, base = open_run(folder, settings.base, settings.motions)
    env = make_env(config, 1, render_mode="rgb_array", camera=settings.camera, threads=1)
    beside = out.with_name(f".{out.stem}.part.mp4")
    try:
        player = load_blended(config, base, env, folder, Blend(settings.alpha, settings.other), settings.base)
        obs, _ = env.reset(seed=settings.seed)
        rate = env.metadata["render_fps"]
        first: Any = env.render()
        writer: Any = imageio.get_writer(beside, fps=rate, macro_block_size=1)
        with writer:
            writer.append_data(first[0])
            for _ in range(1, max(1, round(settings.seconds * rate))):
                obs, *_ = env.step(player.act(tensors(obs), deterministic=True).action.numpy())
                frames: Any = env.render()
                writer.append_data(frames[0])
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)
        env.close()
    return out
