"""A character that is being played: what it can be told, and what is seen of it. No page, no thread, no clock."""

import dataclasses
import math
import sys
from dataclasses import dataclass

import numpy as np
import torch

from murmillo.agents.common.rollout import Rollout, tensors, true_next_obs
from murmillo.envs import EnvConfig, HumanoidVectorEnv
from murmillo.envs.character import CONTROL_DT
from murmillo.envs.falls import FallConfig, FallDetector
from murmillo.envs.markers import Marker
from murmillo.envs.rotations import heading
from murmillo.envs.tasks import Imitation
from murmillo.viewer.goals import Goals
from murmillo.viewer.latents import Latents
from murmillo.viewer.pilots import Pilot

PUSH_STEPS = 6
"""How long a push lasts [control steps]: 0.2 s."""
DOWN_STEPS = 30
"""How long a fallen character is left before a new episode begins [control steps], so that the fall is seen."""

_UP_HEIGHT = 0.5
"""[m] A root above this is up again, as in the task Recovery."""
_ARROW_N = 500.0
"""[N] A push of this size is shown by an arrow of a metre."""


@dataclass(frozen=True)
class Status:
    """How the character does.

    Attributes:
        seconds: since the episode began [s].
        skill: the commanded label; None where it is told none.
        height: of the root [m].
        speed: of the root over the ground [m/s].
        falls: since the session began.
        score: the discriminator's probability that the motion is a clip's; None where nobody judges.
        rewards: terms of the last step, the task's and the judge's, by name.
    """

    seconds: float
    skill: str | None
    height: float
    speed: float
    falls: int
    score: float | None
    rewards: dict[str, float]


@dataclass(frozen=True)
class Frame:
    """What is to be seen at one moment.

    Attributes:
        pose_w: positions [m] and quaternions (wxyz) of the character's bodies and the props behind them, [B + P, 7].
        markers: of the task's goals and of a push.
        status: in figures.
    """

    pose_w: np.ndarray
    markers: tuple[Marker, ...]
    status: Status


def playable(config: EnvConfig) -> EnvConfig:
    """An environment that ends no episode by a fall or by the clock: whether a fall does, the session decides."""
    never = dataclasses.replace(config.fall, height=-math.inf, heights={})
    return dataclasses.replace(config, fall=never, episode_steps=sys.maxsize, autoreset="same_step", threads=1)


class Session:
    """One world and who acts in it, a control step at a time; commands take effect in the next one.

    Equal arguments and equal commands at equal steps give equal frames.

    Attributes:
        skills: labels that can be commanded, which are those that chance may draw; empty where nobody heeds them.
        latents: to be chosen by the user; None where a policy chooses.
        goals: to be set by the user.
        adapted: whose adapters the user may let act in part; None where there are none.
        plays_freely: there is no task, and so no goal.
        stay_down: leave a fallen character where it lies, instead of beginning a new episode.
    """

    def __init__(
        self, env: HumanoidVectorEnv, pilot: Pilot, fall: FallConfig, seed: int, chance: torch.Tensor | None = None
    ) -> None:
        """
        Args:
            env: one world, with the settings that `playable` gives.
            pilot: acts in it.
            fall: what a fall is.
            seed: of all that is drawn.
            chance: `[K]` probabilities of the skills where the user commands none; None draws all alike.
        """
        self.env = env
        known = [name for k, name in enumerate(env.skills) if chance is None or chance[k] > 0]
        self.skills = tuple(known) if pilot.heeds_skill else ()
        self.latents = None if pilot.steerable is None else Latents(pilot.steerable, env.library)
        self.goals = Goals(env, torch.Generator().manual_seed(seed))
        self.adapted = pilot.adapted
        self.plays_freely = isinstance(env.task, Imitation)
        self.stay_down = False
        self._pilot = pilot
        self._chance = chance
        self._has_fallen = FallDetector(env.character, fall)
        self._row = Rollout(1, 1)
        self._push_w, self._push_left = torch.zeros(1, 3, dtype=torch.float64), 0
        self._falls = 0
        self.command_skill(None)
        self.reset(seed)

    # --- commands -----------------------------------------------------------------------------------------------------

    def reset(self, seed: int | None = None) -> None:
        """Begin a new episode: in a clip, or as the task begins."""
        start = {"start": "reference"} if self.plays_freely else {}
        self.env.reset(seed=seed, options=start)
        self._begin()

    def command_skill(self, skill: str | None) -> None:
        """Command a skill until further notice, over the ends of episodes; None leaves it to chance again.

        Raises:
            SuiteError: there is none of that name.
        """
        weights = self._chance
        if skill is not None:
            self.env.set_skill(skill)
            # what an episode begins with, and what a task's clock draws
            weights = torch.tensor([float(name == skill) for name in self.env.skills])
        self.env.set_skill_weights(weights)

    def blend(self, alpha: float) -> None:
        """Let so much of the adaptation act from the next step on, in [0, 1]; of two, 1 - alpha of the second.

        Raises:
            AgentError: alpha is outside.
        """
        if self.adapted is not None:
            self.adapted.blend(alpha)

    def push(self, angle: float, force: float) -> None:
        """Push the root for 0.2 s.

        Args:
            angle: of the push from straight ahead, to the left [rad].
            force: its size [N].
        """
        turn = angle + heading(self.env.state.qpos[0, 3:7]).item()
        self._push_w = force * torch.tensor([[math.cos(turn), math.sin(turn), 0.0]], dtype=torch.float64)
        self._push_left = PUSH_STEPS

    # --- time ---------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Let 1/30 s pass."""
        obs = tensors(self.env.observation())
        step = self._pilot.act(obs)
        if self._push_left:
            self.env.push(self._push_w)
            self._push_left -= 1
        results = self.env.step(step.action.numpy())
        next_obs, _, terminated, _, infos = results
        successor = {f"next_{name}": value for name, value in true_next_obs(next_obs, infos).items()}
        self._row.store(0, {**obs, **step.extras, **successor, "action": step.action})
        self._steps += 1
        if self.latents is not None:
            self.latents.current = step.extras["latent"][0]
        self._judge(infos["reward_terms"])
        if terminated[0]:
            self._begin()
        else:
            self._watch_for_falls()

    def look(self) -> Frame:
        """What is to be seen now."""
        state = self.env.state
        bodies = torch.cat((state.body_pos_w[0], state.body_quat_w[0]), dim=-1)
        pose_w = torch.cat((bodies, state.prop_qpos[0])).numpy().copy()
        markers = self.env.task.markers(state, 0)
        if self._push_left:
            force_w = self._push_w[0]
            markers.append(Marker(pose_w[0, :3].tolist(), force_w.tolist(), float(force_w.norm()) / _ARROW_N))
        label = int(self.env.observation()["skill"][0])
        status = Status(
            seconds=self._steps * CONTROL_DT,
            skill=self.env.skills[label] if self.skills else None,
            height=float(pose_w[0, 2]),
            speed=state.qvel[0, :2].norm().item(),
            falls=self._falls,
            score=self._score,
            rewards=self._rewards,
        )
        return Frame(pose_w, tuple(markers), status)

    def _begin(self) -> None:
        """A new episode has begun: what the user has chosen goes on."""
        self._pilot.reset()
        if self.latents is not None:
            self.latents.renew()
        self.goals.renew()
        self._steps = self._down = self._push_left = 0
        self._score: float | None = None
        self._rewards: dict[str, float] = {}

    def _judge(self, task_terms: dict[str, np.ndarray]) -> None:
        """The reward terms of the step, and the probability D behind style = -log(1 - D)."""
        terms = {} if self.plays_freely else {name: float(x[0]) for name, x in task_terms.items()}
        if (judge := self._pilot.judge) is not None:
            terms |= {name: value.item() for name, value in judge.rewards(self._row).items()}
            self._score = 1.0 - math.exp(-terms["style"]) if "style" in terms else None
        self._rewards = terms

    def _watch_for_falls(self) -> None:
        """A fallen character bounces and rolls, so that it is asked only after a while whether it has got up."""
        if not self._down and not self._has_fallen(self.env.state)[0]:
            return
        self._falls += self._down == 0
        self._down += 1
        if self._down <= DOWN_STEPS:
            return
        if self.env.state.qpos[0, 2] > _UP_HEIGHT:
            self._down = 0
        elif not self.stay_down:
            self.reset()
