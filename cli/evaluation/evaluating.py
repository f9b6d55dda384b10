"""An evaluation from its settings to its report: record, judge, keep, draw, tell."""

import dataclasses
import math
import time
from pathlib import Path
from typing import Any, Literal

from murmillo.agents.common import checkpoint
from murmillo.agents.common.interface import Steerable
from murmillo.cli import runs
from murmillo.cli.agents import AGENTS, load_player, make_agent
from murmillo.cli.ages import measure_ages
from murmillo.cli.config import TrainConfig
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation import history, report
from murmillo.cli.evaluation.chunks import ChunkStore
from murmillo.cli.evaluation.commands import Commander
from murmillo.cli.evaluation.display import make_display
from murmillo.cli.evaluation.figures import Outcome
from murmillo.cli.evaluation.gathering import collect, gather, responds
from murmillo.cli.evaluation.identity import checkpoint_digest, clip_digests, not_comparable
from murmillo.cli.evaluation.plots import plot_all
from murmillo.cli.evaluation.protocols import Protocol
from murmillo.cli.evaluation.recording import Player
from murmillo.cli.evaluation.replay import Replayer
from murmillo.cli.evaluation.scene import Evidence, Scene
from murmillo.cli.evaluation.sources import REPLAYED, SOURCES, TRAINED, UNTRAINED
from murmillo.cli.evaluation.table import COMMANDS, ENCODER, METRICS, RESIDUAL, Metric, choose
from murmillo.envs import HumanoidVectorEnv
from murmillo.envs.falls import FallConfig

CHUNK = 256
"""Trajectories that are recorded side by side; a chunk is 100 MB while it is made."""
_FORMAT = 1
"""Of the chunks: those of another are made anew."""
_ENDLESS = 1_000_000

Start = Literal["default", "reference"]


@dataclasses.dataclass(frozen=True)
class Request:
    """What is to be measured.

    Attributes:
        metrics: names of metrics or of sets of them.
        trajectories: of each source under each protocol; of pushes at most 500.
        seed: of all that is random.
        start: of every trajectory.
        worlds: episodes that the policy is measured in at its ages (`measure_ages`); 0 leaves that out.
        motions: other clips than the run's own, or the place to which those have moved.
    """

    metrics: tuple[str, ...]
    trajectories: int
    seed: int = 12345
    start: Start = "default"
    worlds: int = 0
    motions: str | None = None


def evaluate(config: TrainConfig, folder: Path, request: Request) -> dict[str, Any]:
    """Measure the run in `folder` and write the figures, plots and reports into it.

    What was recorded stays in the folder: the same request later goes on from there.

    Returns:
        What `evaluation/metrics.json` has.

    Raises:
        CommandError: a metric that there is not, or that this run's agent cannot give.
        AgentError: there is no checkpoint, or it does not fit.
        SuiteError: the clips cannot be used.
    """
    begun, motions = time.monotonic(), request.motions or config.env.motions
    saved = checkpoint.load(folder / runs.LAST)
    env = _environment(config, motions, min(request.trajectories, CHUNK))
    try:
        made_of = (config.choices["agent"], config.agent, env, config.seed)
        agents = {TRAINED: load_player(*made_of, folder / runs.LAST), UNTRAINED: make_agent(*made_of)[0]}
        has = _abilities(config, agents[TRAINED], env)
        metrics, left_out = choose(request.metrics, has)
        clips = clip_digests(env.library.clips)
        identity = {
            "run": folder.name,
            "agent": config.choices["agent"],
            "samples": int(saved.get("samples", 0)),
            "checkpoint": checkpoint_digest(folder / runs.LAST),
            "trajectories": request.trajectories,
            "seed": request.seed,
            "start": request.start,
            "not_comparable": not_comparable(folder, request.motions, config.env.motions, clips),
        }
        labelled = COMMANDS in has and ENCODER not in has
        scene = Scene(env.character, env.library, request.seed, labelled)
        key = {name: identity[name] for name in ("checkpoint", "seed", "start")}
        store = ChunkStore(
            folder / runs.EVALUATION / "chunks", env.num_envs, {"format": _FORMAT, "clips": clips, **key}
        )
        commander = Commander(env.library, labelled, ENCODER in has)
        players = {name: Player(env, agent, commander, request.start) for name, agent in agents.items()}
        recorders = {**players, REPLAYED: Replayer(env.character, env.library, scene.states)}
        gather(store, recorders, _protocols(metrics), request.trajectories, request.seed, scene)
        found, curves = _judge(metrics, scene, agents, store, request.trajectories)
    finally:
        env.close()
    results = {
        **identity,
        "clips": {
            "motions": motions,
            "count": len(clips),
            "distinct": len(scene.distinct),
            "names": scene.names,
            "duplicates": scene.duplicates,
            "seconds": round(env.library.duration.sum().item(), 2),
        },
        "hidden": list(config.agent.ppo.hidden),
        "left_out": left_out,
        "seconds": round(time.monotonic() - begun, 1),
        "metrics": found,
    }
    if request.worlds:
        moved = dataclasses.replace(config, env=dataclasses.replace(config.env, motions=motions))
        results["ages"] = measure_ages(moved, folder, request.worlds, request.seed)
    return _keep(folder, identity, results, curves)


def _environment(config: TrainConfig, motions: str, worlds: int) -> HumanoidVectorEnv:
    """Worlds that nothing ends; the ground alone counts as touched."""
    changed = {"motions": motions, "autoreset": "disabled", "episode_steps": _ENDLESS, "fall": FallConfig()}
    return HumanoidVectorEnv(worlds, dataclasses.replace(config.env, **changed))


def _abilities(config: TrainConfig, agent: Any, env: HumanoidVectorEnv) -> set[str]:
    """The keys of `NEEDS` that this agent can give.

    Raises:
        CommandError: nobody else can choose its latents, so that no protocol can be followed.
    """
    if not isinstance(agent, Steerable):
        raise CommandError(f"agent={config.choices['agent']}: takes no latents from outside, and cannot be evaluated")
    encodes = hasattr(agent, "encode")
    told = encodes or (AGENTS[config.choices["agent"]].labelled and len(env.skills) > 1)
    able = {COMMANDS: told, ENCODER: encodes, RESIDUAL: config.env.residual_force > 0}
    return {need for need, given in able.items() if given}


def _judge(
    metrics: list[Metric],
    scene: Scene,
    agents: dict[str, Any],
    store: ChunkStore,
    trajectories: int,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What each metric found on each source, as `metrics.json` and `curves.json` have it."""
    found = {metric.name: _blank(metric) for metric in metrics}
    curves: dict[str, Any] = {metric.name: {} for metric in metrics}
    with make_display(len(SOURCES) * len(metrics)) as display:
        for source in SOURCES:  # one after the other: the windows of 10,000 trajectories are 150 MB
            gathered = {
                protocol.name: collect(store, source, protocol, trajectories)
                for protocol in _protocols(metrics)
                if responds(source, protocol)
            }
            diverged = {name: count for name, (_, count) in gathered.items()}
            evidence = Evidence(scene, source, agents.get(source), {name: kept for name, (kept, _) in gathered.items()})
            for metric in metrics:
                display.doing(f"judging {SOURCES[source]}, {metric.title.lower()}")
                entry, begun = found[metric.name], time.monotonic()
                outcome = metric.judge(evidence)
                entry["seconds"] = round(entry["seconds"] + time.monotonic() - begun, 2)
                entry["diverged"][source] = sum(diverged.get(protocol.name, 0) for protocol in metric.protocols)
                if outcome is not None:
                    _enter(entry, source, outcome)
                    curves[metric.name][source] = outcome.curves
                display.advance(1)
    return found, curves


def _protocols(metrics: list[Metric]) -> list[Protocol]:
    """Those that the metrics judge, each once."""
    return list(dict.fromkeys(protocol for metric in metrics for protocol in metric.protocols))


def _blank(metric: Metric) -> dict[str, Any]:
    figures = {
        kind.name: {"title": kind.title, "unit": kind.unit, "better": kind.better, "values": {}}
        for kind in metric.figures
    }
    protocols = [protocol.title for protocol in metric.protocols]
    return {"title": metric.title, "protocols": protocols, "seconds": 0.0, "diverged": {}, "figures": figures}


def _enter(entry: dict[str, Any], source: str, outcome: Outcome) -> None:
    for name, value in outcome.values.items():
        finite = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in value._asdict().items()}
        entry["figures"][name]["values"][source] = finite


def _keep(folder: Path, identity: dict[str, Any], results: dict[str, Any], curves: dict[str, Any]) -> dict[str, Any]:
    """Write all that is to be read; metrics that were measured before under the same conditions stay."""
    before = runs.read_json(folder / runs.METRICS, {})
    if all(before.get(name) == value for name, value in identity.items()):
        results = {**before, **results, "metrics": _in_order({**before["metrics"], **results["metrics"]})}
        curves = _in_order({**runs.read_json(folder / runs.CURVES, {}), **curves})
    runs.write_json(folder / runs.METRICS, results)
    runs.write_json(folder / runs.CURVES, curves)
    if results["not_comparable"] is None:
        history.add(folder / runs.HISTORY, results)
    pictures = plot_all(results, curves, history.read(folder / runs.HISTORY), folder / runs.EVALUATION / runs.PLOTS)
    report.write(folder, results, pictures)
    return results


def _in_order(entries: dict[str, Any]) -> dict[str, Any]:
    """As the table of metrics has them."""
    return {name: entries[name] for name in METRICS if name in entries}
