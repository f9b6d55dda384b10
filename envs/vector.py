"""N worlds of the character in one physics batch, as a gymnasium vector environment."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
import torch
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from murmillo.envs.bodies import load_body
from murmillo.envs.config import EnvConfig, check_config
from murmillo.envs.devices import at_home, find_device, on
from murmillo.envs.errors import SuiteError
from murmillo.envs.falls import FallDetector, count_every_contact
from murmillo.envs.features import make_features
from murmillo.envs.forces import OutsideForces
from murmillo.envs.guide import Guide
from murmillo.envs.motion import MotionLibrary, load_clips
from murmillo.envs.motion.demonstrations import Demonstrations
from murmillo.envs.observer import LIMIT, Observer, box
from murmillo.envs.physics import Physics, State, make_physics
from murmillo.envs.rendering import FrameRenderer, Window, make_screen
from murmillo.envs.scene import Scene, slippery
from murmillo.envs.skills import CommandedSkills
from murmillo.envs.starts import FALLEN, KINDS, RECOVERY, REFERENCE, StartSampler
from murmillo.envs.tasks import Imitation, Task
from murmillo.envs.tasks.goals import uniform
from murmillo.envs.terrain import make_terrain
from murmillo.envs.tracking import PROGRESS_SIZE, Tracker

RENDERED_WORLDS = 16

_OWN_STATE = ("steps", "free_steps", "ended", "fell")
"""What the environment itself carries from step to step, beside the physics and its generator."""


class HumanoidVectorEnv(VectorEnv):
    """N worlds of one character, stepped together.

    Observations (a dict):
        state: [N, 120] float32, the table in `murmillo.envs.observations.character_state`; with `features="links"`
            [N, 4, 13 B] (`murmillo.envs.features.LinkFeatures`), of which `length` [N] int64 frames count.
        heights: [N, 35, 35] float32, the ground about the root (only on uneven ground; `Terrain.map`).
        progress: [N, 10] float32, how far along which clip it is and how well it follows, for critics (only where
            `tracking.follow`; `Tracker.progress`).
        skill: [N] int64, the commanded label, an index into `skills`; random and independent of the start, but for the
            share `starts.commanded` of the starts in a clip.
        window: [N, W, 120] float32, the last W states, oldest first (only if `window` > 1); [N, W, 7 B] of links. After
            a reference start its past is the clip's own, after other starts the first state repeated.

    Actions: [N, 31] in [-1, 1], PD targets at the joints (`Character.targets`); with `residual_force` > 0 [N, 76], the
    last 45 being the residual forces at 15 joints in the heading frame, in units of that scale.

    Reward: the sum of the task's terms, which `info["reward_terms"]` holds by name.

    End: `terminated` by a fall (`FallConfig`) or by the task, `truncated` after `episode_steps` or off uneven ground.

    Info: `reward_terms`, `fall` [N] bool, `healed` [N] bool (a world whose simulation diverged and was reset), and in
    SAME_STEP mode `final_obs`, the observation before any reset for all N worlds, with its mask `_final_obs` [N]. With
    residual forces also `side_rewards`, terms that are not the task's ("residual", their regularising reward), and the
    L2 norms [N] of `residual_force` [N] over all joints and of `joint_torque` [N m], of the PD control, over all axes.

    With `tensors` all of these are torch tensors on `device` in place of arrays; `home` is where the physics and all
    state around it are.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 30}  # noqa: RUF012 gymnasium's own type

    def __init__(
        self,
        num_envs: int = 1,
        config: EnvConfig | None = None,
        task: Task | None = None,
        render_mode: Literal["rgb_array", "human"] | None = None,
    ) -> None:
        """Raises SuiteError (MotionError for clips) naming the argument that cannot be."""
        self.config = config = config or EnvConfig()
        check_config(config, render_mode, self.metadata["render_modes"])
        self.num_envs = num_envs
        self.render_mode = render_mode
        self._mode = AutoresetMode[config.autoreset.upper()]
        self.metadata = {**type(self).metadata, "autoreset_mode": self._mode}
        self.task = task or Imitation()
        edit = count_every_contact if config.fall.contact == "any" else None
        self.character = load_body(config.character, config.body, edit)
        self.terrain = make_terrain(config.terrain)
        self.scene = Scene(self.character, self._lay_out)
        features, followed = make_features(config.features, self.character), self.character.base
        clips = load_clips(config.motions, followed, config.clips)
        if self.terrain is not None and self.scene.props:
            raise SuiteError(f"terrain: the props of {type(self.task).__name__} need level ground; leave it flat")
        self.physics = self._make_physics()
        self.home = self.physics.device
        self.device = find_device(config.device) if config.physics == "cpu" else self.home
        self.library = MotionLibrary(clips, followed, self.home, features)
        with on(self.home):
            self._surround()
        shown = self.library if self.device == self.home else MotionLibrary(clips, followed, self.device, features)
        self.demonstrations = Demonstrations(shown, self.character, config.window, self._action_dim)
        self._screen: FrameRenderer | Window | None = None

    def _make_physics(self) -> Physics:
        config = self.config
        if config.physics == "cpu":
            return make_physics(self.scene, self.num_envs, threads=config.threads)
        return make_physics(
            self.scene,
            self.num_envs,
            backend=config.physics,
            device=config.device,
            contacts=config.contacts,
            constraints=config.constraints,
        )

    def _surround(self) -> None:
        """Make all that keeps a state beside the physics."""
        config, num_envs, features = self.config, self.num_envs, self.library.features
        self.task.bind(num_envs, self.character)
        self._fallen = FallDetector(self.character, config.fall)
        self._observer = Observer(features, num_envs, config.window, self.terrain)
        frames = self._observer.frames.shape[1]
        self._starts = StartSampler(self.character, self.library, config.starts, num_envs, frames, config.threads)
        self._forces = OutsideForces(self.character, config, num_envs)
        self._set_spaces()
        self._generator = torch.Generator(self.home)
        self._generator.seed()
        self._steps = torch.zeros(num_envs, dtype=torch.int64)
        self._free_steps = torch.zeros(num_envs, dtype=torch.int64)
        self._skills = CommandedSkills(self.library.skills, num_envs)
        self._tracker = self._guide = None
        if config.tracking.follow:
            self._tracker = Tracker(self.character, self.library, self._skills, config.tracking, num_envs)
            self._guide = Guide(self.character, self._tracker, self._forces)
        self._ended = torch.zeros(num_envs, dtype=torch.bool)
        self._fell = torch.zeros(num_envs, dtype=torch.bool)

    @property
    def skills(self) -> tuple[str, ...]:
        """Names of the labels that `skill` counts."""
        return self.library.skills

    @property
    def residual_dim(self) -> int:
        """How many of an action's numbers, its last, are residual forces."""
        return self._forces.residual_dim

    @property
    def tensors(self) -> bool:
        """Whether steps and resets give tensors."""
        return self.config.tensors

    @property
    def state(self) -> State:
        """The live physical state of all worlds."""
        return self.physics.state

    # --- gymnasium ---------------------------------------------------------------------------------------------------

    @at_home
    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: of everything random in all worlds from here on.
            options: `reset_mask` [N] bool resets these worlds only; `start` ("reference", "default", "fallen") makes
                all starts of one kind.
        """
        if seed is not None:
            words = np.random.SeedSequence(seed).generate_state(2)
            self._generator.manual_seed(int(words[0]) << 31 ^ int(words[1]))
            self._np_random, self._np_random_seed = seeding.np_random(int(words[0]))
            self._fell.fill_(False)
            self._starts.forget()
        options = options or {}
        start = options.get("start")
        if start is not None and start not in KINDS[:RECOVERY]:
            raise SuiteError(f"options['start']={start}: no such start; there are: {', '.join(KINDS[:RECOVERY])}")
        mask = torch.as_tensor(options.get("reset_mask", np.ones(self.num_envs, dtype=bool)), device=self.home)
        self._restart(mask, None if start is None else KINDS.index(start))
        return self._shown(self._observation()), self._shown({"fall": torch.zeros(self.num_envs, dtype=torch.bool)})

    @at_home
    def step(self, actions: np.ndarray | Tensor) -> tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]:
        """Advance all worlds by 1/30 s. See the class for what comes back."""
        resetting = self._ended & (self._mode is AutoresetMode.NEXT_STEP)
        info = self._advance(torch.as_tensor(actions, device=self.home))
        terms = {name: term.masked_fill(resetting, 0.0) for name, term in self.task.reward(self.state).items()}
        healed = self.physics.healed()
        fall = self._fallen(self.state, self._observer.ground) & (self._steps > 1) & (self._free_steps == 0)
        lost = self._track(info, resetting)
        terminated = (fall | lost | self.task.terminated(self.state) | healed) & ~resetting
        over = self._steps >= self.config.episode_steps
        if self.terrain is not None:
            over |= ~self.terrain.contains(self.state.qpos)
        truncated = over & ~terminated & ~resetting
        self._pass_time()
        self._ended, self._fell = terminated | truncated, torch.where(resetting, self._fell, fall)
        self._starts.note(self._ended.nonzero().squeeze(-1), terminated[self._ended])
        info |= {"reward_terms": terms, "fall": fall & terminated, "healed": healed}
        if self._mode is AutoresetMode.SAME_STEP:
            info["final_obs"], info["_final_obs"] = self._observation(), self._ended
            self._restart(self._ended)
        else:
            self._restart(resetting)
        reward = torch.stack(list(terms.values())).sum(0).double()
        return self._shown((self._observation(), reward, terminated, truncated, info))

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Frames [height, width, 3] of the worlds, of the first 16 at most; `render_mode="human"` shows world 0."""
        if self.render_mode is None:
            return None
        if self._screen is None:
            config, human = self.config, self.render_mode == "human"
            self._screen = make_screen(self.scene, human, config.width, config.height, config.camera)
        state, worlds = self.state, range(min(self.num_envs, RENDERED_WORLDS))
        poses = torch.cat((state.qpos, state.prop_qpos.flatten(1)), dim=-1)[: len(worlds)]
        return self._screen.draw(poses.cpu().double().numpy(), [self.task.markers(state, world) for world in worlds])

    def close_extras(self, **kwargs: Any) -> None:
        if self._screen is not None:
            self._screen.close()
            self._screen = None
        self.physics.close()

    # --- directions ---------------------------------------------------------------------------------------------------

    @at_home
    def set_skill(self, skill: str | int, env_ids: Sequence[int] | None = None) -> None:
        """Command a skill from now on, until the episode's end.

        Args:
            skill: its name or its index in `skills`.
            env_ids: the worlds; None is all.
        """
        self._skills.command(skill, env_ids)

    def set_skill_weights(self, weights: Tensor | None) -> None:
        """Draw the skills of new episodes with these probabilities, [K] and not negative; None draws all alike."""
        self._skills.weigh(None if weights is None else weights.to(self.home))

    def set_ground_contact(self, allowed: bool) -> None:
        """Whether bodies other than the feet may touch the ground as `fall` and `starts` say; else any touch is a fall.

        Without it no episode begins fallen or where the last one fell. It is the curriculum of C.ASE (appendix A.5).
        """
        if not allowed and self.config.fall.contact == "any":
            raise SuiteError("fall.contact=any: forbidding the ground needs fall.contact=ground, its touch alone")
        self._fallen.touch_is_fall = not allowed
        self._starts.on_ground = allowed

    @at_home
    def push(self, force_w: Tensor, body: str | None = None) -> None:
        """Push the character from outside, throughout the next step and no longer; pushes add up.

        `state_dict` does not keep them.

        Args:
            force_w: [N, 3] [N] at the body's origin, beside any residual force there.
            body: its name; None is the root.
        """
        self._forces.push(force_w.to(self.home), body)

    @at_home
    def observation(self) -> dict[str, Any]:
        """The current observation, which a `set_skill` since the last step has changed."""
        return self._shown(self._observation())

    @at_home
    def guide(self) -> Any:
        """The actions [N, A] that lead along the clips from here, for learners; see `Guide`.

        Raises:
            SuiteError: nobody follows a clip.
        """
        if self._guide is None:
            raise SuiteError("tracking.follow=false: there is no guide where no clip is followed")
        return self._shown(self._guide.action(self.state, self._observer.ground))

    # --- checkpoints -------------------------------------------------------------------------------------------------

    @at_home
    def state_dict(self) -> dict[str, Any]:
        """All that the next step depends on, but for what others set: skill weights and `set_ground_contact`."""
        parts = {"physics": self.physics.state_dict(), "starts": self._starts.state_dict()}
        parts |= {"task": self.task.state_dict(), "forces": self._forces.state_dict()}
        if self._tracker is not None:
            parts["tracking"] = self._tracker.state_dict()
        own = {name: getattr(self, f"_{name}").clone() for name in _OWN_STATE}
        seen = {"history": self._observer.frames.clone(), "skill": self._skills.current.clone()}
        return {**parts, "generator": self._generator.get_state(), **seen, **own}

    @at_home
    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Continue from `state_dict`, bit for bit."""
        generator = state["generator"].cpu()
        state = _moved(state, self.home)
        self.physics.load_state_dict(state["physics"])
        self._starts.load_state_dict(state["starts"])
        self.task.load_state_dict(state["task"])
        self._forces.load_state_dict(state["forces"])
        if self._tracker is not None:
            self._tracker.load_state_dict(state["tracking"])
        self._generator.set_state(generator)
        self._observer.load(self.state, state["history"])
        self._skills.current = state["skill"].clone()
        for name in _OWN_STATE:
            setattr(self, f"_{name}", state[name].clone())

    # --- inside a step -----------------------------------------------------------------------------------------------

    def _lay_out(self, spec: mujoco.MjSpec) -> None:
        """Put the ground and the task's props into the scene."""
        if self.terrain is not None:
            self.terrain.edit(spec)
        if self.config.friction is not None:
            slippery(spec)
        self.task.edit(spec)

    def _set_spaces(self) -> None:
        observations = {**self._observer.spaces(), "skill": gymnasium.spaces.Discrete(len(self.skills))}
        if self.config.tracking.follow:
            observations["progress"] = box((PROGRESS_SIZE,))
        if self.task.goal_dim:
            observations["goal"] = box((self.task.goal_dim,))
        self._action_dim = self.character.action_dim + self.residual_dim
        self.single_observation_space = gymnasium.spaces.Dict(observations)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (self._action_dim,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def _advance(self, action: Tensor) -> dict[str, Any]:
        """Physics, clocks and history of one control step; what info says of the residual forces."""
        expected = (self.num_envs, self._action_dim)
        if action.shape != expected:
            raise SuiteError(f"action of shape {tuple(action.shape)}: needs {expected}")
        action = action.to(self.state.qpos.dtype)
        joints, extra = action.split([self.character.action_dim, expected[1] - self.character.action_dim], dim=-1)
        force = self._forces.of_step(extra, self.state, self.task.push(self.state))
        self.physics.step(self.character.targets(joints), force)
        self._steps += 1
        self._free_steps = (self._free_steps - 1).clamp_min(0)
        self._observer.see(self.state)
        return self._forces.report(self.state)

    def _track(self, info: dict[str, Any], resetting: Tensor) -> Tensor:
        """Who has lost its clip [N] bool; the reward for following it goes into the side rewards of info."""
        if self._tracker is None:
            return torch.zeros_like(resetting)
        reward, lost = self._tracker.step(self._observer.frames[:, -1], self._generator)
        info.setdefault("side_rewards", {})["tracking"] = reward.masked_fill(resetting, 0.0)
        return lost & (self._steps > 1) & (self._free_steps == 0)

    def _restart(self, mask: Tensor, kind: int | None = None) -> None:
        """New episodes in the worlds of mask [N] bool."""
        ids = mask.nonzero().squeeze(-1)
        if not len(ids):
            return
        starts = self._starts.draw(ids, self._fell[ids], self._generator, kind)
        moved = starts.kind != RECOVERY
        if self.terrain is not None:
            starts = self._starts.moved(starts, self.terrain.settle(self.character, starts.qpos, ids, self._generator))
        if self.config.friction is not None:
            self.physics.set_friction(ids, uniform(len(ids), self.config.friction, self._generator))
        self.physics.write(ids[moved], starts.qpos[moved], starts.qvel[moved])
        self._observer.begin(self.state, ids[moved], ids[starts.kind == REFERENCE], starts.frames[:, :-1])
        free = (starts.kind == RECOVERY) | (starts.kind == FALLEN)
        self._steps[ids] = 0
        self._free_steps[ids] = torch.where(free, self.config.starts.free_steps, 0)
        self._skills.draw(ids, self._generator)
        own = starts.commanded
        owners = ids[starts.kind == REFERENCE][own]
        self._skills.put(owners, starts.skill[own])
        if self._tracker is not None:
            self._tracker.turn(ids, self._generator)
            self._tracker.begin(owners, starts.clip[own], starts.time[own])
        self._ended = self._ended & ~mask
        self.task.reset(ids, self.state, self._generator)
        self._forces.reset(ids, self._generator)

    def _pass_time(self) -> None:
        """New goals and skills where their time is over."""
        self.task.advance(self.state, self._generator)
        self._forces.advance(self._generator)
        if self.task.skill_steps:
            due = (self._steps % self.task.skill_steps == 0).nonzero().squeeze(-1)
            if len(due):
                self._skills.draw(due, self._generator)

    def _observation(self) -> dict[str, Tensor]:
        observation = {**self._observer.observation(self._steps), "skill": self._skills.current.clone()}
        if self._tracker is not None:
            observation["progress"] = self._tracker.progress.clamp(-LIMIT, LIMIT)
        if self.task.goal_dim:
            observation["goal"] = self.task.goal(self.state)
        return observation

    def _shown(self, result: Any) -> Any:
        """The tensors in a result as the environment gives them out: on its device, or as arrays."""
        return _moved(result, self.device) if self.config.tensors else _arrays(result)


def _moved(result: Any, device: torch.device) -> Any:
    """A result with its tensors on the device."""
    return _each(result, lambda tensor: tensor.to(device))


def _arrays(result: Any) -> Any:
    """A result with arrays in place of tensors."""
    return _each(result, lambda tensor: tensor.cpu().numpy())


def _each(result: Any, change: Callable[[Tensor], Any]) -> Any:
    """The result with its tensors changed, however deep they are in tuples and dicts."""
    if isinstance(result, Tensor):
        return change(result)
    if isinstance(result, tuple):
        return tuple(_each(part, change) for part in result)
    if isinstance(result, dict):
        return {name: _each(part, change) for name, part in result.items()}
    return result
