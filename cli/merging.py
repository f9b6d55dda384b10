"""What `murmillo merge` does: the adapted policy as one network, in a run's folder that is whole or not there."""

import dataclasses
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from murmillo.agents.common import checkpoint
from murmillo.agents.common.errors import AgentError
from murmillo.agents.common.interface import Obs, Steerable
from murmillo.agents.common.rollout import tensors
from murmillo.cli import config as configuration
from murmillo.cli import report as skill_report
from murmillo.cli import runs
from murmillo.cli.adaptation import report as adaptnet_report
from murmillo.cli.adaptation import world as adaptnet
from murmillo.cli.adaptation.evaluating import evaluate as evaluate_adaptnet
from murmillo.cli.adaptation.words import is_adaptnet_run
from murmillo.cli.ages import measure_ages
from murmillo.cli.bases import SETTING
from murmillo.cli.blending import Blend, load_blended
from murmillo.cli.devices import for_playing
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.identity import checkpoint_digest
from murmillo.cli.tasks import table
from murmillo.cli.tasks.words import is_task_run
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.motion.licences import Terms, terms_of, together

TOLERANCE = 1e-5
"""Between an action and that of the merged policy: rounding makes about a tenth of it."""
_WORLDS, _STEPS, _SEED = 32, 32, 1
"""Moments at which the two are put side by side."""
_COPIED = (runs.VERSIONS, runs.CLIPS, runs.SKILLS, runs.SCALARS)
"""What the new run has of the adaptation: how it was made, and how it learned."""


@dataclass(frozen=True)
class Adaptation:
    """A run that adapts another, as its commands open it.

    Attributes:
        word: as the user named it.
        folder: of the run.
        config: its settings.
        base: the run that it adapts, of AdaptNet; None of the others, whose checkpoints have their base within.
        moved: where that has moved to.
    """

    word: str
    folder: Path
    config: Any
    base: Any = None
    moved: str | None = None

    @property
    def of_adaptnet(self) -> bool:
        return is_adaptnet_run(str(self.folder))

    def world(self, num_envs: int) -> HumanoidVectorEnv:
        """N worlds of it. Raises SuiteError where they cannot be made."""
        if self.of_adaptnet:
            return adaptnet.make_env(self.config, num_envs)
        shown = dataclasses.replace(for_playing(self.config.env), autoreset="same_step")
        return HumanoidVectorEnv(num_envs, shown)

    def player(self, env: HumanoidVectorEnv, blend: Blend) -> Any:
        """Its agent in such worlds, with its adapters as was told.

        Raises:
            AgentError: its checkpoint is damaged.
            CommandError: what was told cannot be.
        """
        if self.of_adaptnet:
            return adaptnet.load_blended(self.config, self.base, env, self.folder, blend, self.moved)
        return load_blended(self.config, env, self.folder / runs.LAST, blend)

    def report(self, worlds: int) -> Path:
        """Measure it in so many episodes, none for 0, and write its report."""
        if worlds and self.of_adaptnet:
            measures = table.by_player(evaluate_adaptnet(self.config, self.base, self.folder, worlds))
        else:
            measures = measure_ages(self.config, self.folder, worlds) if worlds else {}
        if measures:
            runs.write_json(self.folder / runs.MEASURES, measures)
        return (adaptnet_report if self.of_adaptnet else skill_report).write(self.folder)


def open_adaptation(word: str, base: str | None = None, motions: str | None = None) -> Adaptation:
    """The run that `run=word` names.

    Args:
        word: of the run.
        base: of AdaptNet: where the run that it adapts has moved; None where it still is.
        motions: the same of the clips, of any.

    Raises:
        CommandError: there is no such run, it adapts none, or its base is missing.
        AgentError: its checkpoint is damaged.
    """
    folder = runs.existing(word, "run")
    if is_task_run(word):
        raise CommandError(f"run={word}: this run has learned a task; name a run that adapts another's policy")
    if is_adaptnet_run(word):
        config, found = adaptnet.open_run(folder, base, motions)
        opened = Adaptation(word, folder, config, found, base)
    else:
        if base is not None:
            raise CommandError(f"base={base}: this run has its base in its checkpoint; drop this")
        config = configuration.load(folder)
        moved = config.env.motions if motions is None else motions
        opened = Adaptation(
            word, folder, dataclasses.replace(config, env=dataclasses.replace(config.env, motions=moved))
        )
    if (made := config.choices.get(runs.MERGED)) is not None:
        raise CommandError(f"run={word}: this run is merged already, of {made}; name that one")
    if config.base is None:
        raise CommandError(f"run={word}: this run adapts no other; there is nothing to merge it with")
    return opened


def save(adaptation: Adaptation, blend: Blend, into: Path) -> tuple[Adaptation, float]:
    """Write the merged run, whole or not at all.

    Args:
        adaptation: that is merged.
        blend: how its adapters act.
        into: folder of the new run.

    Returns:
        the new run, and how far its actions are from those of the adaptation, at most.

    Raises:
        CommandError: the adapters are of a kind that cannot be merged, or the folder cannot be written.
        AgentError, SuiteError: the run cannot be used.
    """
    beside = into.with_name(f".{into.name}.writing")
    env = adaptation.world(_WORLDS)
    try:
        agent = adaptation.player(env, blend)
        moments, latent = _moments(agent, env)
        before = _actions(agent, moments, latent)
        try:
            agent.merge()
        except AgentError as error:
            raise CommandError(f"run={adaptation.word}: {error}") from None
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir()
        merged = _write(adaptation, blend, agent, env, beside, into)
        again = merged.player(env, Blend())
        difference = (_actions(again, moments, latent) - before).abs().max().item()
        if not difference <= TOLERANCE:  # so written, a NaN is refused too
            raise CommandError(
                f"run={adaptation.word}: merged, its actions would differ by {difference:.1e}; it stays as it is"
            )
        beside.rename(into)
    except OSError as error:
        raise CommandError(f"into={into}: cannot be written ({error.strerror or error})") from None
    finally:
        env.close()
        shutil.rmtree(beside, ignore_errors=True)
    return dataclasses.replace(merged, folder=into), difference


def _write(
    adaptation: Adaptation, blend: Blend, agent: Any, env: HumanoidVectorEnv, beside: Path, into: Path
) -> Adaptation:
    """All that makes a run of the merged agent, in the folder `beside`, and that run as it can be opened there."""
    made = {
        "run": str(adaptation.folder),
        "digest": checkpoint_digest(adaptation.folder / runs.LAST),
        **blend.identity().get("blend", {}),
    }
    saved = checkpoint.load(adaptation.folder / runs.LAST)
    terms = dataclasses.asdict(_terms(adaptation, blend, env))
    origin = {name: saved["meta"].pop(name) for name in (SETTING, f"{SETTING}_digest")}  # it needs that no more
    meta = {**saved["meta"], "terms": terms, runs.MERGED: {**origin, **made}}
    state = {"meta": meta, "agent": agent.state_dict(), "samples": saved["samples"], "iteration": saved["iteration"]}
    checkpoint.save(beside / runs.LAST, state)
    place = dataclasses.replace(adaptation.config.run, root=str(into.parent), name=into.name, resume=None)
    how = f"{adaptation.folder} {blend}".strip()
    choices = {**adaptation.config.choices, runs.MERGED: how}
    config = dataclasses.replace(adaptation.config, run=place, choices=choices)
    configuration.save(config, beside)
    for name in _COPIED:
        if (adaptation.folder / name).is_file():
            shutil.copyfile(adaptation.folder / name, beside / name)
    runs.write_json(beside / runs.TERMS, terms)
    return Adaptation(str(into), beside, config)


def _terms(adaptation: Adaptation, blend: Blend, env: HumanoidVectorEnv) -> Terms:
    """Those of all clips that the new weights come from: the run's, the other run's and, as far as it is there, the
    base's."""
    folders = [Path(adaptation.config.base)] if adaptation.base is None else [adaptation.base.folder]
    folders += [] if blend.other is None else [Path(blend.other)]
    found = [runs.read_json(folder / runs.TERMS) for folder in (adaptation.folder, *folders)]
    return together(terms_of(env.library.clips), *(_read(terms) for terms in found if terms is not None))


def _read(terms: dict[str, Any]) -> Terms:
    return Terms(tuple(terms["licences"]), tuple(terms["sources"]), terms["redistributable"])


@torch.no_grad()
def _moments(agent: Any, env: HumanoidVectorEnv) -> tuple[list[Obs], Tensor | None]:
    """What is seen while the agent acts, and the latents `[N, Z]` that it acts under."""
    latent = agent.draw_latents(env.num_envs) if isinstance(agent, Steerable) else None
    obs, _ = env.reset(seed=_SEED)
    moments = []
    for _ in range(_STEPS):
        moments.append(tensors(obs))
        obs, *_ = env.step(_actions(agent, moments[-1:], latent).numpy())
    return moments, latent


@torch.no_grad()
def _actions(agent: Any, moments: Sequence[Obs], latent: Tensor | None) -> Tensor:
    """The likeliest actions `[M N, A]`."""
    if latent is not None:
        agent.follow(latent)
    return torch.cat([agent.act(obs, deterministic=True).action for obs in moments])
