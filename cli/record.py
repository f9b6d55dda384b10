"""`murmillo record`: film a trained agent without a screen."""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from murmillo.cli import gl
from murmillo.cli.errors import CommandError

HELP = """\
murmillo record: film a trained agent

  murmillo record run=runs/<name>                    ten seconds, as video.mp4 in the run's folder

  run       needed           folder of the run
  seconds   10               length of the film
  skill     by chance        name of the commanded skill
  clips     none             CALM: names of clips to follow one after the other, clips=[walk_forward,kick]
  blend     false            CALM: go from one clip to the next evenly instead of at once
  camera    track            track, side or front
  out       video.mp4        file, in the run's folder unless it is a path
  seed      1                of the start
  motions   the run's own    a folder or file, where the clips have moved
  low       the run's own    of a run that learned a task: folder of the low-level run, where it has moved

  murmillo record machine=location run=runs/<calm> heading=runs/<precision>
                                                     a task done by a state machine, with its state in the picture

  machine   needed           location, strike or a YAML file (docs/machines.md)
  run       needed           folder of a run of agent=calm
  heading   where needed     folder of a run of task=direction over it, by which states go somewhere
  seconds   an attempt's     length of the film
  out       by machine       file, in the run's folder unless it is a path
  style=walk_forward and the like set the machine's parameters; camera, seed and motions as above

  murmillo record run=runs/<adaptation> alpha=0.5     half way between a base, of any method, and its adaptation
  murmillo record run=runs/<one> with=runs/<other> alpha=0.3      0.3 of the one and 0.7 of the other of the same base

  alpha     all of it        how much of the adaptation acts, 0 to 1; of two 0.5
  with      none             folder of another adaptation of the same base
  base      the run's own    AdaptNet: folder of the run that it adapts, where it has moved
  seconds, camera, out, seed and motions as above

A run that learned a task is shown with its goals; it follows no clips.
Works without a screen, through EGL or OSMesa; `murmillo doctor` says whether this machine has one of them.
"""


@dataclass
class RecordConfig:
    """What `murmillo record` takes; see `HELP`."""

    run: str
    seconds: float = 10.0
    skill: str | None = None
    clips: tuple[str, ...] = ()
    blend: bool = False
    camera: str = "track"
    out: str = "video.mp4"
    seed: int = 1
    motions: str | None = None
    alpha: float | None = None
    other: str | None = None


def run(words: list[str]) -> int:
    """Film the run's last checkpoint."""
    # MuJoCo reads its choice when it is imported, so nothing that imports it may come before this line
    tried = gl.candidates()
    backend = gl.choose()
    from murmillo.cli import runs
    from murmillo.cli.seeds import check_seed

    planned = _plan(words)
    if not 0.0 < planned.seconds < math.inf:  # so written, a NaN is refused too
        raise CommandError(f"seconds={planned.seconds:g}: needs a number above 0")
    check_seed("seed", planned.seed)
    folder = runs.existing(planned.run, "run")
    out = Path(planned.out) if os.path.dirname(planned.out) else folder / planned.out
    if out.suffix != ".mp4" or out.is_dir() or not out.parent.is_dir():
        raise CommandError(f"out={planned.out}: needs a file name that ends in .mp4, in a folder that exists")
    if backend is None:
        raise CommandError(gl.no_gl_message(tried))
    planned.make(folder, out)
    print(f"filmed {planned.seconds:g} s: {out}")
    return 0


class _Film(NamedTuple):
    """What is to be filmed: the run, how long, where to, from which seed, and by what from the two folders."""

    run: str
    seconds: float
    out: str
    seed: int
    make: Callable[[Path, Path], Any]


def _plan(words: list[str]) -> _Film:
    """A machine, a run of AdaptNet, one that has learned a task, or one that has learned from clips."""
    from murmillo.cli import config as configuration
    from murmillo.cli.adaptation.words import is_adaptnet_run
    from murmillo.cli.blending import Blend, renamed
    from murmillo.cli.tasks.words import is_task_run, value_of

    if value_of(words, "machine") is not None:
        from murmillo.cli.machines import record as machines

        return _Film(*machines.plan(words))
    if is_adaptnet_run(value_of(words, "run")):
        from murmillo.cli.adaptation import record as adaptnet

        shown = adaptnet.parse(words)
        return _Film(
            shown.run, shown.seconds, shown.out, shown.seed, lambda folder, out: adaptnet.film(folder, shown, out)
        )
    if is_task_run(value_of(words, "run")):
        from murmillo.cli.tasks import record as tasks

        task = configuration.parse(tasks.TaskRecordConfig, words)
        return _Film(task.run, task.seconds, task.out, task.seed, lambda folder, out: tasks.film(folder, task, out))
    own = configuration.parse(RecordConfig, renamed(words))
    Blend(own.alpha, own.other)  # a mistake shows before the run is read
    if own.blend and len(own.clips) < 2:
        raise CommandError("blend=true: goes from one clip to the next; name two or more, clips=[walk_forward,kick]")
    return _Film(
        own.run, own.seconds, own.out, own.seed, lambda folder, out: film(configuration.load(folder), folder, own, out)
    )


def film(config: Any, folder: Path, settings: RecordConfig, out: Path) -> Path:
    """Write the film of one world to `out`, whole or not at all, and return it.

    Raises:
        SuiteError: nothing can be drawn, or there is no such skill or camera.
        AgentError: the checkpoint is missing or does not fit.
        CommandError: its adapters cannot act as is asked.
    """
    import dataclasses

    import imageio.v2 as imageio
    import torch

    from murmillo.agents.common.rollout import tensors
    from murmillo.cli import runs
    from murmillo.cli.blending import Blend, load_blended
    from murmillo.cli.devices import for_playing
    from murmillo.envs import HumanoidVectorEnv

    motions = settings.motions or config.env.motions
    shown = dataclasses.replace(
        for_playing(config.env), camera=settings.camera, motions=motions, autoreset="same_step", threads=1
    )
    env = HumanoidVectorEnv(1, shown, render_mode="rgb_array")
    beside = out.with_name(f".{out.stem}.part.mp4")
    try:
        player = load_blended(config, env, folder / runs.LAST, Blend(settings.alpha, settings.other))
        obs, _ = env.reset(seed=settings.seed, options={"start": "reference"})
        _command(env, settings.skill)
        follow = _follower(settings, player, env)
        first = _frame(env)
        writer: Any = imageio.get_writer(beside, fps=env.metadata["render_fps"], macro_block_size=1)
        with writer:
            writer.append_data(first)
            frames = round(settings.seconds * env.metadata["render_fps"])
            for frame in range(1, frames):
                follow(frame / frames)
                step = player.act(tensors(obs), deterministic=True)
                obs, _, terminated, truncated, _ = env.step(step.action.numpy())
                if terminated[0] or truncated[0]:
                    player.reset(torch.zeros(1, dtype=torch.int64))
                    _command(env, settings.skill)
                writer.append_data(_frame(env))
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)
        env.close()
    return out


def _follower(settings: RecordConfig, player: Any, env: Any) -> Callable[[float], None]:
    """Tells the player which clip to follow at a part [0, 1) of the film; does nothing where no clips are asked for.

    Raises:
        CommandError: the agent follows no clips.
    """
    from murmillo.agents.common.latents import interpolate
    from murmillo.cli.encodings import encode_middles

    if not settings.clips:
        return lambda part: None
    if not hasattr(player, "encode"):
        raise CommandError(
            f"clips={list(settings.clips)}: this run's agent follows no clips; choose a run of agent=calm"
        )
    latents = encode_middles(player, env.library, settings.clips)

    def follow(part: float) -> None:
        place = part * (len(latents) - 1 if settings.blend else len(latents))
        number = min(int(place), len(latents) - 1)
        if settings.blend and number + 1 < len(latents):
            player.follow(interpolate(latents[number], latents[number + 1], place - number))
        else:
            player.follow(latents[number])

    return follow


def _command(env: Any, skill: str | None) -> None:
    if skill is not None:
        env.set_skill(skill)


def _frame(env: Any) -> Any:
    frames = env.render()
    return frames[0]
