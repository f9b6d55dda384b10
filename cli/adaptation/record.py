"""`murmillo record` of a run of AdaptNet, with as much of its adaptation as is asked for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from murmillo.cli.errors import CommandError


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

    named = [f"other={word[len('with=') :]}" if word.startswith("with=") else word for word in words]
    settings = configuration.parse(AdaptNetRecordConfig, named)
    if settings.alpha is not None and not 0.0 <= settings.alpha <= 1.0:
        raise CommandError(
            f"alpha={settings.alpha:g}: 0 is without the adapter, 1 with all of it; name a number between"
        )
    return settings


def film(folder: Path, settings: AdaptNetRecordConfig, out: Path) -> Path:
    """Write the film of one world to `out`, whole or not at all, and return it.

    Raises:
        SuiteError: nothing can be drawn, or there is no such camera.
        AgentError: the checkpoint is missing or does not fit, or has no adapters to blend.
        CommandError: the base is missing or has changed.
    """
    import imageio.v2 as imageio

    from murmillo.agents.common.rollout import tensors
    from murmillo.cli.adaptation.world import make_env, open_run

    config, base = open_run(folder, settings.base, settings.motions)
    env = make_env(config, 1, render_mode="rgb_array", camera=settings.camera, threads=1)
    beside = out.with_name(f".{out.stem}.part.mp4")
    try:
        player = blended(config, base, env, folder, settings)
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


def blended(config: Any, base: Any, env: Any, folder: Path, settings: AdaptNetRecordConfig) -> Any:
    """The run's agent, with alpha of its adapter; with another run, alpha of this one's and 1 - alpha of that one's.

    Raises:
        AgentError: a checkpoint does not fit, a policy has no adapter, or the other adapts another base.
        CommandError: the other run cannot be read.
    """
    from murmillo.agents.common.errors import AgentError
    from murmillo.cli import runs
    from murmillo.cli.adaptation.words import AGENT, is_adaptnet_run
    from murmillo.cli.adaptation.world import load_agent, open_run

    player = load_agent(config, base, env, folder)
    if settings.other is not None:
        theirs = runs.existing(settings.other, "with")
        if not is_adaptnet_run(settings.other):
            raise CommandError(f"with={settings.other}: this is no run of agent={AGENT}")
        other, other_base = open_run(theirs, settings.base)
        try:
            player.join(load_agent(other, other_base, env, theirs))
        except AgentError as error:
            raise CommandError(f"with={settings.other}: {error}") from None
    if settings.alpha is not None:
        player.blend(settings.alpha)
    return player
