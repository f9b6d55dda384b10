"""`murmillo train`: one run, or with --multirun one for each combination of settings."""

from murmillo.cli.errors import CommandError

HELP = """\
murmillo train: train an agent on motion clips

  murmillo train                                     ASE on the built-in clips, under ten minutes on two cores
  murmillo train motions=PATH                        on your own clips: a folder or one file
  murmillo train budget=laptop seed=2                longer, with another seed
  murmillo train ablation=no_diversity               without a part of the method
  murmillo train run.resume=runs/<name>              take a stopped run up again
  murmillo train --multirun seed=1,2,3               one run for each value

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
    if flags:
        from murmillo.cli.sweep import sweep

        return sweep(settings)
    from murmillo.cli.config import compose_train
    from murmillo.cli.training import train

    return train(compose_train(settings))
