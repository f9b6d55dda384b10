"""Where a task is played: the environment, what the policy acts in, and the policy itself."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import torch
from gymnasium.vector import VectorEnv
from torch import Tensor

from murmillo.agents.case.high_level import HybridDecoder, hybrid_agent
from murmillo.agents.common import checkpoint
from murmillo.agents.common.latent_env import LatentEnv, Results
from murmillo.agents.common.ranks import ALONE, Ranks
from murmillo.agents.common.rollout import taken
from murmillo.agents.common.task_agent import TaskAgent
from murmillo.cli.devices import for_playing, for_training
from murmillo.cli.tasks.config import TaskTrainConfig
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.styles import style_reward, style_weights
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.observations import state_dim

OnStep = Callable[[Tensor, Results], None]
"""Is called after every control step with the character's actions `[N, A]` and what they gave."""


class World:
    """N worlds of a task, as the policy sees them.

    Attributes:
        env: the task's environment, a control step at a time.
        decisions: what the policy acts in: decisions over the low-level policy, or `env` itself where there is none.
        skill_weights: `[K]` probabilities of the skills that are commanded; None where all are alike.
    """

    def __init__(
        self,
        config: TaskTrainConfig,
        below: LowRun | None,
        num_envs: int,
        *,
        judged: bool = False,
        render_mode: Literal["rgb_array"] | None = None,
        **changes: Any,
    ) -> None:
        """
        Args:
            config: of the run.
            below: the run whose policy is followed; None where the policy acts itself.
            num_envs: N.
            judged: for training: with the low-level agent's reward terms, and on the device of the settings.
            render_mode: of the environment.
            changes: of its settings.

        Raises:
            SuiteError, CommandError: something of it cannot be made.
        """
        settings = dataclasses.replace((for_training if judged else for_playing)(config.env), **changes)
        self.env = HumanoidVectorEnv(num_envs, settings, config.make_task(), render_mode)
        try:
            self.hybrid = config.choices["agent"] == "case" and not self.env.task.skill_steps
            self._observers: list[OnStep] = []
            styles = config.precision.skills
            self.skill_weights = style_weights(styles, self.env.library) if config.commands_styles else None
            self.env.set_skill_weights(self.skill_weights)
            self.decisions: VectorEnv = self.env
            if below is not None:
                low = below.load(self.env)
                decoder = HybridDecoder(len(self.env.skills), low.latent_dim) if self.hybrid else None
                terms = config.latent_env.terms if judged else ()
                decided = dataclasses.replace(config.latent_env, terms=terms)
                nearness = style_reward(config, self.env, low) if config.commands_styles else None
                self.decisions = LatentEnv(
                    self.env, low, decided, decoder=decoder, latent_terms=nearness, on_step=self._observers
                )
        except BaseException:
            self.env.close()
            raise

    def observe(self, on_step: OnStep) -> None:
        """Call this after every control step from now on."""
        self._observers.append(on_step)

    def step(self, action: Tensor) -> Results:
        """One decision of actions `[N, A]`, with all that observe."""
        results = self.decisions.step(taken(self.decisions, action))
        if self.decisions is self.env:
            for call in self._observers:
                call(action, results)  # type: ignore[arg-type] # which is what a vector environment gives
        return results  # type: ignore[return-value]

    def close(self) -> None:
        self.env.close()


def make_policy(config: TaskTrainConfig, world: World, ranks: Ranks = ALONE) -> tuple[TaskAgent, torch.Generator]:
    """The policy as it is before training, and the generator that it draws from: equal for equal arguments."""
    generator = torch.Generator(world.env.device).manual_seed(config.seed)
    if world.hybrid:
        return hybrid_agent(world.decisions, config.agent, generator, ranks=ranks), generator
    return TaskAgent(world.decisions, config.agent, generator, ranks=ranks), generator


def load_policy(config: TaskTrainConfig, world: World, folder: Path) -> TaskAgent:
    """The policy of a checkpoint.

    Raises:
        AgentError: the checkpoint is damaged, or made for another task or character.
    """
    policy, _ = make_policy(config, world)
    saved = checkpoint.load(folder)
    checkpoint.check_compatible(saved["meta"], policy_meta(config, world))
    policy.load_state_dict(saved["agent"])
    return policy


def policy_meta(config: TaskTrainConfig, world: World) -> dict[str, Any]:
    """What a checkpoint must share with the environment and the policy that it is loaded into."""
    space = world.decisions.single_action_space
    assert space.shape is not None
    return {
        "task": config.choices["task"],
        "agent": config.choices["agent"],
        "character": world.env.config.character,
        "state_dim": state_dim(world.env.character),
        "goal_dim": world.env.task.goal_dim,
        "action_dim": space.shape[0],
        **({"skills": list(world.env.skills)} if world.hybrid or config.agent.skill else {}),
    }
