"""`murmillo train`: one run, or with --multirun one for each combination of settings."""

import sys
from collections.abc import Callable
from typing import Any

from murmillo.cli.adaptation.words import adapt_skills, are_about_adaptnet
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
  murmillo train --multirun hydra/launcher=joblib seed=1,2,3    several at a time; also submitit_slurm, ray
  torchrun --nproc-per-node=4 -m murmillo.cli.train num_envs=16384    one run by four processes (docs/scaling.md)
  murmillo train task=location low=runs/<name>       a task, by the skills of a trained agent
  murmillo train task=location low=none              the same task without an agent below
  murmillo train base=runs/<name> to=friction        adapt a trained agent of ase, calm or case to another world
  murmillo train agent=adaptnet                      a humanoid that walks to places, the base of adaptations
  murmillo train agent=adaptnet stage=adapt base=runs/<name> to=style clips=[jaunty]

Settings are written name=value. The first ones:

  agent      ase, case, calm or adaptnet             the method
  motions    builtin, a folder or a file             what it learns from
  budget     smoke (10 minutes), laptop (2 hours), paper (as published)
  ablation   none, no_skill_discovery, no_diversity, neither, no_focal, no_masking, residual
  seed       1                                       of everything random
  num_envs   512                                     worlds that are simulated together
  physics    cpu or warp                             warp simulates on a GPU (docs/gpu.md)
  device     auto, cpu, cuda:0 and the like          where it learns; auto is where the physics is
  threads    0                                       CPU threads; 0 takes every core
  run.name   by time, agent, budget and seed         folder of the run under run.root=runs
  run.evaluate  true                                 measure the quick metrics of `murmillo evaluate` at the end
  run.video  true                                    film the trained character at the end
  run.keep_every                                     keep a checkpoint every so many samples, for the curves of
                                                     `murmillo evaluate checkpoint=all`

With task=… a high-level policy learns to choose what the agent of another run does; its first settings:

  task       reach, speed, steering, location, direction, relocation, path_follow, strike, block, recovery or
             navigate; its arguments are task.radius=5 and the like (docs/tasks.md)
  low        folder of a run of ase, case or calm, whose clips and character it takes over; or none
  precision  over a run of calm, where the task commands skills: precision.skills=[run_forward,crouch_walk] are the
             styles of CALM's precision training
  budget     smoke (10 minutes), laptop (2 hours), paper
  run.video, run.name, run.root, run.resume, seed, num_envs, threads: as above

With base=… the policy of a run of ase, calm or case is adapted; latents and labels go on meaning what they meant:

  to         friction, terrain, body or pushes       env.friction=[0.35,0.35] and the like say more (docs/adaptnet.md)
  agent.adapter.rank, agent.injection_penalty and agent.weight_decay are of the adapter; all else is as in the base

With agent=adaptnet a policy learns to go to places in the style of the clips, and is then adapted (docs/adaptnet.md):

  stage      base or adapt                           a policy from nothing, or an adaptation of base=runs/<name>
  to         style, body, lock, friction, terrain, obstacles or pushes
  method     adaptnet, scratch, finetune, finetune_regularised or progressive
  ablation   none, injection_z1, injection_z2, injection_all, latent_only, no_own_encoder, internal_only, lora
  task.gait  walk or run
  motions, clips, budget, seed, num_envs, threads, run.name and the like: as above

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
    if are_about_adaptnet(settings):
        return _train_adaptnet(settings, multirun=bool(flags))
    if are_about_a_task(settings):
        return _train_task(settings, multirun=bool(flags))
    settings = [word for word in settings if not word.startswith("task=")]
    if adapt_skills(settings):
        return _adapt_skills(settings, multirun=bool(flags))
    if flags:
        from murmillo.cli.sweep import sweep

        return sweep(settings)
    from murmillo.cli.config import compose_train
    from murmillo.cli.training import train

    return _train_one(compose_train, train, settings)


def _train_one(compose: Callable[[list[str]], Any], train: Callable[..., int], words: list[str]) -> int:
    """One run, of this process or of all that torchrun has started."""
    from murmillo.cli.launch import agreed, launched

    with launched() as ranks:
        return train(agreed(ranks, lambda: compose(words)), ranks=ranks)


def _train_task(words: list[str], multirun: bool) -> int:
    """One run of a task, or one after the other for each combination of values."""
    from murmillo.cli.tasks.config import compose_task
    from murmillo.cli.tasks.training import train

    return _train_all(compose_task, train, words, multirun)


def _train_adaptnet(words: list[str], multirun: bool) -> int:
    """One base or adaptation, or one after the other for each combination of values."""
    from murmillo.cli.adaptation.config import compose_adaptnet
    from murmillo.cli.adaptation.training import train

    return _train_all(compose_adaptnet, train, words, multirun)


def _adapt_skills(words: list[str], multirun: bool) -> int:
    """One adaptation of a policy of ASE, CALM or C·ASE, or one after the other for each combination of values."""
    from murmillo.cli.bases import compose_adaptation
    from murmillo.cli.training import train

    return _train_all(compose_adaptation, train, words, multirun)


def _train_all(compose: Callable[[list[str]], Any], train: Callable[..., int], words: list[str], multirun: bool) -> int:
    if not multirun:
        return _train_one(compose, train, words)
    from murmillo.cli.launchers import chosen
    from murmillo.cli.sweep import combinations

    if (launcher := chosen(words)) is not None:
        raise CommandError(f"hydra/launcher={launcher}: these runs are made one after the other; leave it out")
    configs = [compose(list(combination)) for combination in combinations(words)]  # a mistake shows before any run
    for number, config in enumerate(configs):
        train(config, suffix=f"-{number}")
    return 0


if __name__ == "__main__":  # what torchrun starts: torchrun -m murmillo.cli.train agent=ase
    from murmillo.cli.main import main

    sys.exit(main(["train", *sys.argv[1:]]))
