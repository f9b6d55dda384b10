"""`murmillo play`: steer a trained character in a browser."""

import importlib.util
import os
import socket
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from murmillo.cli.errors import CommandError

if TYPE_CHECKING:
    from murmillo.viewer.session import Session

HELP = """\
murmillo play: steer a trained character in a browser

  murmillo play run=runs/<name>                      then open the address that it prints; Ctrl-C ends it

  run       needed           folder of the run
  port      8080             of the page
  host      127.0.0.1        address to listen at; 0.0.0.0 lets other machines in, who may then steer too
  seed      1                of all that is drawn
  motions   the run's own    a folder or file, where the clips have moved
  low       the run's own    of a run that learned a task: folder of the low-level run, where it has moved
  alpha     all of it        of a run that adapts another: how much of the adaptation acts, 0 to 1; a slider on the page
  with      none             folder of another adaptation of the same base, of which 1 - alpha acts

What can be told is on the page: skills, latents, clips to follow and to blend, goals, pushes. docs/play.md explains it.
Needs viser: pip install 'murmillo[play]'
"""


@dataclass
class PlayConfig:
    """What `murmillo play` takes; see `HELP`."""

    run: str
    port: int = 8080
    host: str = "127.0.0.1"
    seed: int = 1
    motions: str | None = None


@dataclass
class AgentPlayConfig(PlayConfig):
    """What it takes for a run that has learned from clips."""

    alpha: float | None = None
    other: str | None = None


@dataclass
class TaskPlayConfig(PlayConfig):
    """What it takes for a run that has learned a task."""

    low: str | None = None


def run(words: list[str]) -> int:
    """Play the run's last checkpoint until the user ends it."""
    import torch

    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.adaptation.words import is_adaptnet_run
    from murmillo.cli.blending import renamed
    from murmillo.cli.seeds import check_seed
    from murmillo.cli.tasks.words import is_task_run, value_of

    if is_adaptnet_run(named := value_of(words, "run")):
        raise CommandError(f"run={named}: the page does not steer AdaptNet yet; film it: murmillo record run={named}")
    of_task = is_task_run(value_of(words, "run"))
    settings = configuration.parse(TaskPlayConfig if of_task else AgentPlayConfig, renamed(words))
    check_seed("seed", settings.seed)
    folder = runs.existing(settings.run, "run")
    _check_address(settings.host, settings.port)
    if importlib.util.find_spec("viser") is None:
        raise CommandError("play: the page needs viser, which is not installed: pip install 'murmillo[play]'")
    torch.set_num_threads(1)  # one world is too little work to share
    if isinstance(settings, AgentPlayConfig):
        session = _open_agent(folder, settings)
    else:
        session = _open_task(folder, settings)

    from murmillo.viewer.serving import serve

    def ready(address: str) -> None:
        print(f"open {address} to play {settings.run}; Ctrl-C ends it", flush=True)

    try:
        serve(session, f"murmillo: {folder.name}", settings.host, settings.port, threading.Event(), ready)
    except KeyboardInterrupt:
        print("ended")
    finally:
        session.env.close()
    return 0


def _open_agent(folder: Path, settings: AgentPlayConfig) -> "Session":
    """A session with an agent that has learned from clips.

    Raises:
        SuiteError: the clips cannot be read.
        AgentError: the checkpoint is missing or does not fit.
        CommandError: its adapters cannot act as is asked.
    """
    import dataclasses

    from murmillo.cli import config as configuration
    from murmillo.cli import runs
    from murmillo.cli.blending import Blend, load_blended
    from murmillo.cli.devices import for_playing
    from murmillo.envs import HumanoidVectorEnv
    from murmillo.viewer.pilots import AgentPilot
    from murmillo.viewer.session import Session, playable

    blend = Blend(settings.alpha, settings.other)
    config = configuration.load(folder)
    shown = dataclasses.replace(for_playing(config.env), motions=settings.motions or config.env.motions)
    env = HumanoidVectorEnv(1, playable(shown))
    player = load_blended(config, env, folder / runs.LAST, blend)
    return Session(env, AgentPilot(player), shown.fall, settings.seed)


def _open_task(folder: Path, settings: TaskPlayConfig) -> "Session":
    """A session with a policy that has learned a task.

    Raises:
        SuiteError: the clips cannot be read.
        AgentError: the checkpoint is missing or does not fit.
        CommandError: the low-level run is missing or has changed.
    """
    from murmillo.agents.common.latent_env import LatentEnv
    from murmillo.cli import runs
    from murmillo.cli.tasks.opening import open_run
    from murmillo.cli.tasks.world import World, load_policy
    from murmillo.viewer.pilots import PolicyPilot
    from murmillo.viewer.session import Session, playable

    config, below = open_run(folder, settings.low, settings.motions)
    fall, config.env = config.env.fall, playable(config.env)
    world = World(config, below, 1)
    policy = load_policy(config, world, folder / runs.LAST)
    decisions = world.decisions if isinstance(world.decisions, LatentEnv) else None
    return Session(world.env, PolicyPilot(policy, decisions), fall, settings.seed, world.skill_weights)


def _check_address(host: str, port: int) -> None:
    """Refuse an address that cannot be listened at.

    Raises:
        CommandError: naming what is wrong with it.
    """
    if not 1 <= port <= 65535:
        raise CommandError(f"port={port}: needs a number from 1 to 65535")
    if (reason := _why_not(host, port)) is not None:
        raise CommandError(f"port={port}: cannot be listened at on host={host} ({reason}); choose another")


def _why_not(host: str, port: int) -> str | None:
    """What keeps this machine from listening there; None where nothing does."""
    try:
        socket.getaddrinfo(host, port, socket.AF_INET)
    except (socket.gaierror, UnicodeError):
        return "there is no such IPv4 address"
    try:
        with socket.create_server((host, port)):
            return None
    except OSError as error:
        return os.strerror(error.errno or 0)
