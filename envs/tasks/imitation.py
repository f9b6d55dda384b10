"""Moving like the clips: the task of low-level training, whose reward comes from the agent's discriminator."""

from murmillo.envs.tasks.interface import Task


class Imitation(Task):
    """No goal and no reward: zero by design, under the name `task`. Episodes end by falls and by the clock alone."""
