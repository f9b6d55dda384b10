"""`murmillo train`: one run, or with --multirun one for each combination of settings."""

from murmillo.cli.errors import CommandError
from murmillo.cli.tasks.words import are_about_a_task

HELP = """\
murmillo train: train an agent on motion clips

  murmillo train                                     ASE on the built-in clips, under ten minutes on two cores
  murmillo train motions=PATH                        on your own clips: a folder or one file
  murmillo train budget=laptop seed=2                longer, with another seed
  murmillo train ablation=no_diversity               without a part of the method
  murmillo train run.resume=runs/<name>              take a stopped run up again
  murmillo train --multirun seed=1,2,3               one run for each value
  murmillo train task=location low=runs/<name>       a task, by the skills of a trained agent
  murmillo train task=location low=none              the same task without an agent below

Settings are written name=value. The first ones:

  agent      ase, case or calm                       the method
  motions    builtin, a folder or a file             what it learns from
  budget     smoke (10 minutes), laptop (2 hours), paper (as published)
  ablation   none, no_skill_discovery, no_diversity, neither, no_focal, no_masking, residual
  seed       1                                       of everything random
  num_envs   512                                     worlds that are simulated together
  threads    0                                       CPU threads; 0 takes every core
  run.name   by time, agent, budget and seed         folder of the run under run.root=runs
  run.evaluate  true                                 measure the quick metrics of `murmillo evaluate` at the end
  run.video  true                                    film the trained character at the end
  run.keep_every                                     keep a checkpoint every so many samples, for the curves of
                                                     `murmillo evaluate checkpoint=all`

With task=… a high-level policy learns to choose what the agent of another run does; its first settings:

  task       reach, speed, steering, location, direction, relocation, path_follow, strike, block or recovery;
             its arguments are task.radius=5 and the like (docs/tasks.md)
  low        folder of a run of ase, case or calm, whose clips and character it takes over; or none
  precision  over a run of calm, where the task commands skills: precision.skills=[run_forward,crouch_walk] are the
             styles of CALM's precision training
  budget     smoke (10 minutes), laptop (2 hours), paper
  run.video, run.name, run.root, run.resume, seed, num_envs, threads: as above

`config.yaml` in the folder of a run shows every setting; each can be given here by its dotted name, such as
agent.ppo.std=0.05 or runner.max_minutes=30. Ctrl-C ends a run after the iteration under way, with a checkpoint.
"""


def run(words: list[str]) -> int:
    """Train as the words of the command line say; the exit status."""
    flags = [word for word in words if word.startswith("-")]
    settings = [word for word in words if not word.startswith("-")]
    for flag in flags:
        if flag not in ("--multirun", "-m"):
            raise CommandError(f"{flag}: there is no such option; known are --multirun and --help")
    if are_about_a_task(settings):
        return _train_task(settings, multirun=bool(flags))
    settings = [word for word in settings if not word.startswith("task=")]
    if flags:
        from murmillo.cli.sweep import sweep

        return sweep(settings)
    from murmillo.cli.config import compose_train
    from murmillo.cli.training import train

    return train(compose_train(settings))


def _train_task(words: list[str], multirun: bool) -> int:
    """One run of a task, or one after the other for each combination of values."""
    from murmillo.cli.tasks.config import compose_task
    from murmillo.cli.tasks.training import train

    if not multirun:
        return train(compose_task(words))
    from murmillo.cli.sweep import combinations

    configs = [compose_task(list(combination)) for combination in combinations(words)]  # a mistake shows before any run
    for number, config in enumerate(configs):
        train(config, suffix=f"-{number}")
    return 0
