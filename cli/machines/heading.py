"""The policy that takes a machine's character somewhere: a run of CALM's precision training (section 6.1)."""

from torch import Tensor

from murmillo.agents.common.interface import Obs
from murmillo.cli import runs
from murmillo.cli.errors import CommandError
from murmillo.cli.tasks.low import LowRun
from murmillo.cli.tasks.opening import open_run
from murmillo.cli.tasks.styles import style_names
from murmillo.cli.tasks.words import is_task_run
from murmillo.cli.tasks.world import World, load_policy
from murmillo.envs.physics import State
from murmillo.envs.tasks.steering import Steering


class HeadingPolicy:
    """Chooses latents that lead in a direction, at a speed, in a style.

    Attributes:
        styles: skills that it was trained to be told.
        decision_steps: control steps that each of its latents is followed for.
    """

    def __init__(self, word: str, below: LowRun, num_worlds: int, motions: str) -> None:
        """
        Args:
            word: `heading=word`, the folder of its run.
            below: the run that it was trained over.
            num_worlds: N.
            motions: the clips.

        Raises:
            CommandError: there is no such run, it was trained for something else or over another run.
            AgentError: its checkpoint is damaged.
        """
        folder = runs.existing(word, "heading")
        if not is_task_run(word):
            raise CommandError(f"heading={word}: this run has learned no task; {how_to_train(below)}")
        try:
            config, below_it = open_run(folder, below.word, motions)
        except CommandError as error:
            raise CommandError(f"heading={word}: {error}") from None
        task = config.make_task()
        if not isinstance(task, Steering) or not config.commands_styles:
            raise CommandError(f"heading={word}: this run is told no direction and style; {how_to_train(below)}")
        # the policy has no worlds of its own: one is enough for its spaces and its clips
        world = World(config, below_it, 1, threads=1)
        try:
            self._policy = load_policy(config, world, folder / runs.LAST)
            self._skills = world.env.skills
            self.styles = tuple(style_names(config.precision.skills, world.env.library))
            self.decision_steps = config.latent_env.steps
            task.bind(num_worlds, world.env.character)
        finally:
            world.close()
        self._task = task

    def index(self, style: str) -> int:
        """Of a skill, as the policy is told it."""
        return self._skills.index(style)

    def latents(self, obs: Obs, state: State, direction_w: Tensor, speed: Tensor, style: Tensor) -> Tensor:
        """Latents `[N, Z]`, of any length.

        Args:
            obs: of the worlds.
            state: of the same.
            direction_w: `[N, 2]` unit vectors in the world, to go and to face.
            speed: `[N]` [m/s].
            style: `[N]` int64, their indices.
        """
        goals = self._task.goals
        goals["direction_w"], goals["facing_w"], goals["speed"] = direction_w, direction_w, speed
        told = {"state": obs["state"], "goal": self._task.goal(state), "skill": style}
        return self._policy.act(told, deterministic=True).action


def how_to_train(below: LowRun) -> str:
    """The end of a sentence: the command that trains such a policy."""
    return f"train one: murmillo train task=direction low={below.word}"
