"""`murmillo record` of a run that learned a task: a film with the goals in the picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass
class TaskRecordConfig:
    """What `murmillo record` takes for such a run; see `murmillo.cli.record.HELP`."""

    run: str
    seconds: float = 10.0
    skill: str | None = None
    camera: str = "track"
    out: str = "video.mp4"
    seed: int = 1
    low: str | None = None
    motions: str | None = None


def film(folder: Path, settings: TaskRecordConfig, out: Path) -> Path:
    """Write the film of one world to `out`, whole or not at all, and return it.

    Raises:
        SuiteError: nothing can be drawn, or there is no such skill or camera.
        AgentError: the checkpoint is missing or does not fit.
        CommandError: the low-level run is missing or has changed.
    """
    import imageio.v2 as imageio

    from murmillo.agents.common.rollout import tensors
    from murmillo.cli import runs
    from murmillo.cli.tasks.opening import open_run
    from murmillo.cli.tasks.world import World, load_policy

    config, below = open_run(folder, settings.low, settings.motions)
    world = World(config, below, 1, render_mode="rgb_array", camera=settings.camera, threads=1)
    beside = out.with_name(f".{out.stem}.part.mp4")
    try:
        policy = load_policy(config, world, folder / runs.LAST)
        _command(config, world.env, settings.skill)
        obs, _ = world.decisions.reset(seed=settings.seed)
        rate = world.env.metadata["render_fps"]
        frames = _Frames(world.env, max(1, round(settings.seconds * rate)))
        frames.add()
        world.observe(lambda action, results: frames.add())
        writer: Any = imageio.get_writer(beside, fps=rate, macro_block_size=1)
        with writer:
            while frames.missing:
                obs, *_ = world.step(policy.act(tensors(obs), deterministic=True).action)
                frames.write(writer)
            frames.write(writer)
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)
        world.close()
    return out


class _Frames:
    """Draws a picture a control step until there are enough, and hands them on."""

    def __init__(self, env: Any, missing: int) -> None:
        self.missing = missing
        self._env = env
        self._drawn: list[Any] = []

    def add(self) -> None:
        """Draw the world as it is."""
        if self.missing:
            self._drawn.append(self._env.render()[0])
            self.missing -= 1

    def write(self, writer: Any) -> None:
        for frame in self._drawn:
            writer.append_data(frame)
        self._drawn.clear()


def _command(config: Any, env: Any, skill: str | None) -> None:
    """Have this skill drawn for every episode, and whenever another one is due.

    Raises:
        SuiteError: there is none of that name.
        CommandError: the run has not learned that one.
    """
    import torch

    from murmillo.cli.tasks.styles import check_style

    if skill is None:
        return
    env.set_skill(skill)  # refuses one that there is not
    if config.commands_styles:
        check_style(skill, config.precision.skills, env.library)
    env.set_skill_weights(torch.tensor([float(name == skill) for name in env.skills]))
