"""Worlds in which a machine directs a trained agent of CALM."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import torch
from omegaconf import OmegaConf
from torch import Tensor

from murmillo.agents.calm.machine.execution import Execution
from murmillo.agents.calm.machine.machine import Vocabulary
from murmillo.agents.common.latent_env import LatentEnv
from murmillo.agents.common.rollout import tensors
from murmillo.cli import runs
from murmillo.cli.config import merge
from murmillo.cli.errors import CommandError
from murmillo.cli.machines.commands import Commands
from murmillo.cli.machines.files import Chosen
from murmillo.cli.machines.heading import HeadingPolicy, how_to_train
from murmillo.cli.schema import build, schema_of
from murmillo.cli.tasks import low as low_runs
from murmillo.cli.tasks.config import TaskTrainConfig, compose_task
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.names import task_class
from murmillo.cli.tasks.words import is_task_run
from murmillo.cli.tasks.world import World
from murmillo.envs.character import CONTROL_DT
from murmillo.envs.errors import SuiteError


@dataclass
class MachineSettings:
    """What the commands take for a machine, whatever they do with it."""

    machine: str
    run: str
    heading: str | None = None
    motions: str | None = None
    threads: int = 0


class MachineScene:
    """N worlds of a task that a machine does.

    Attributes:
        below: the run of the agent.
        world: the environment, with the agent's latents as its actions.
        machine: that chooses them.
        execution: where it stands in each world, since `reset`.
    """

    execution: Execution

    def __init__(
        self, settings: MachineSettings, chosen: Chosen, num_worlds: int, seconds: float, **world: Any
    ) -> None:
        """
        Args:
            settings: of the command.
            chosen: the machine.
            num_worlds: N.
            seconds: that an attempt has; it is rounded up to whole decisions.
            world: further arguments of `World`, and changes of the environment's settings.

        Raises:
            CommandError, AgentError, SuiteError: a run, the machine or the environment cannot be used.
        """
        self.below = agent_run(settings.run)
        config = _task_settings(chosen, self.below, settings.motions)
        heading = _heading_policy(settings, chosen, self.below, num_worlds, config.env.motions)
        if heading is not None:
            config.latent_env = dataclasses.replace(config.latent_env, steps=heading.decision_steps)
        self._steps = config.latent_env.steps
        decisions = max(1, math.ceil(seconds / (self._steps * CONTROL_DT) - 1e-9))
        # no fall ends an attempt, as in CALM's release: who falls may get up
        never = dataclasses.replace(config.env.fall, height=-math.inf, heights={})
        changes = {"episode_steps": decisions * self._steps, "fall": never, "threads": settings.threads}
        self.world = World(config, self.below, num_worlds, **changes, **world)
        try:
            env, decided = self.world.env, self.world.decisions
            assert isinstance(decided, LatentEnv)
            clips = tuple(clip.name for clip in env.library.clips)
            styles = () if heading is None else heading.styles
            names = Vocabulary(tuple(env.task.quantity_docs), tuple(env.task.place_docs), clips, styles)
            self.machine = chosen.file.machine(names, chosen.parameters)
            self._commands = Commands(self.machine, decided.low, env, heading)
        except BaseException:
            self.close()
            raise

    def reset(self, seed: int) -> None:
        """Begin in all worlds."""
        obs, _ = self.world.decisions.reset(seed=seed)
        self._obs = tensors(obs)
        self.execution = Execution(self.machine, self.world.env.num_envs, self._steps * CONTROL_DT)

    @torch.no_grad()
    def step(self) -> Tensor:
        """One decision in every world: the states [N] that it is made in."""
        env = self.world.env
        states = self.execution.step(env.task.quantities(env.state))
        obs, _, terminated, truncated, _ = self.world.step(self._commands.latents(states, self._obs))
        self._obs = tensors(obs)
        ended = torch.as_tensor(terminated) | torch.as_tensor(truncated)
        self.execution.reset(ended.nonzero().flatten())
        return states

    def close(self) -> None:
        self.world.close()


def agent_run(word: str) -> LowRun:
    """The run of CALM that `run=word` names.

    Raises:
        CommandError: there is none, it has no checkpoint, or it is of an agent that encodes no clips.
    """
    runs.existing(word, "run")
    if is_task_run(word):
        raise CommandError(f"run={word}: this run has learned a task; name its low-level run, and it as heading={word}")
    below = low_runs.find(word, "run")
    assert below is not None
    if below.kind != "calm":
        raise CommandError(f"run={word}: a run of {below.kind}, which encodes no clips; a machine needs agent=calm")
    return below


def _task_settings(chosen: Chosen, below: LowRun, motions: str | None) -> TaskTrainConfig:
    """Those of the machine's task over the run.

    Raises:
        CommandError, AgentError: the machine names no task, or an argument that it has not.
    """
    file = chosen.file
    try:
        arguments: Any = task_class(file.task).config_type
    except CommandError as error:
        raise file.error("task", error) from None
    config = compose_task([f"task={file.task}", f"low={below.word}"])
    try:
        values: Any = OmegaConf.to_container(
            merge(OmegaConf.structured(schema_of(arguments)), file.arguments, []), enum_to_str=True
        )
        config.task = build(arguments, values)
        config.make_task()  # refuses values that cannot be
    except (CommandError, SuiteError) as error:
        raise file.error("arguments", f"arguments: {error}") from None
    if motions is not None:
        config.env = dataclasses.replace(config.env, motions=motions)
    return config


def _heading_policy(
    settings: MachineSettings, chosen: Chosen, below: LowRun, num_worlds: int, motions: str
) -> HeadingPolicy | None:
    """The policy that states go by; None where none goes anywhere.

    Raises:
        CommandError, AgentError: there is none where one is needed, or it does not serve.
    """
    if not chosen.file.heads:
        return None
    if settings.heading is None:
        raise CommandError(
            f"machine={chosen.word}: some of its states go somewhere, which needs heading=runs/<name>; "
            f"{how_to_train(below)}"
        )
    return HeadingPolicy(settings.heading, below, num_worlds, motions)
