"""What the evaluations of a run's checkpoints share: the worlds, the clips, and how figures come from a policy."""

import dataclasses
import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from murmillo.agents.common import checkpoint
from murmillo.agents.common.interface import Steerable
from murmillo.cli.agents import AGENTS, load_untrained, make_agent
from murmillo.cli.blending import NOTHING, Blend, load_blended
from murmillo.cli.config import TrainConfig
from murmillo.cli.devices import for_playing
from murmillo.cli.errors import CommandError
from murmillo.cli.evaluation.chunks import ChunkStore
from murmillo.cli.evaluation.commands import Commander
from murmillo.cli.evaluation.display import make_display
from murmillo.cli.evaluation.figures import Outcome
from murmillo.cli.evaluation.gathering import Recorder, collect, gather, responds
from murmillo.cli.evaluation.identity import checkpoint_digest, clip_digests, not_comparable
from murmillo.cli.evaluation.protocols import Protocol
from murmillo.cli.evaluation.recording import Player
from murmillo.cli.evaluation.replay import Replayer
from murmillo.cli.evaluation.scene import Evidence, Scene
from murmillo.cli.evaluation.sources import REPLAYED, SOURCES, TRAINED, UNTRAINED
from murmillo.cli.evaluation.table import COMMANDS, ENCODER, RESIDUAL, Metric, choose
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
        along: the checkpoints that the run kept on its way, too.
        blend: how the adapters of the run's policy act.
    """

    metrics: tuple[str, ...]
    trajectories: int
    seed: int = 12345
    start: Start = "default"
    worlds: int = 0
    motions: str | None = None
    along: bool = False
    blend: Blend = NOTHING


@dataclasses.dataclass(frozen=True)
class Measured:
    """What was found of one checkpoint.

    Attributes:
        identity: what it is of and how it was measured; figures of equal ones belong together.
        metrics: as `metrics.json` has them.
        curves: as `curves.json` has them.
    """

    identity: dict[str, Any]
    metrics: dict[str, Any]
    curves: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Bench:
    """A request about one run, ready to be put to its checkpoints.

    Attributes:
        config, folder: of the run.
        clips: `clip_digests` of those that the policy is put beside.
        metrics: that are asked for and can be given; left_out: why others cannot, by name.
        labelled, encodes: what the run's agent is told, see `Commander`.
    """

    config: TrainConfig
    folder: Path
    request: Request
    env: HumanoidVectorEnv
    scene: Scene
    clips: dict[str, str]
    metrics: list[Metric]
    left_out: dict[str, str]
    labelled: bool
    encodes: bool

    def identity(self, path: Path) -> dict[str, Any]:
        """Which checkpoint lies at `path`, and under which conditions it is measured.

        Raises:
            AgentError: none does.
        """
        request = self.request
        return {
            "run": self.folder.name,
            "agent": self.config.choices["agent"],
            "samples": int(checkpoint.load(path).get("samples", 0)),
            "checkpoint": checkpoint_digest(path),
            "trajectories": request.trajectories,
            "seed": request.seed,
            "start": request.start,
            "not_comparable": not_comparable(self.folder, request.motions, self.config.env.motions, self.clips),
            **request.blend.identity(),
        }

    def measure(self, path: Path, chunks: Path, sources: tuple[str, ...] = tuple(SOURCES)) -> Measured:
        """Record what the folder `chunks` has not yet, and judge it.

        Args:
            path: of the checkpoint.
            sources: that are measured; `TRAINED` is the checkpoint.

        Raises:
            AgentError: there is no checkpoint, or it does not fit.
        """
        identity, request = self.identity(path), self.request
        made_of = (self.config.choices["agent"], self.config.agent, self.env, self.config.seed)
        make = {
            TRAINED: lambda: load_blended(self.config, self.env, path, request.blend),
            UNTRAINED: lambda: load_untrained(*made_of, path),
        }
        agents = {source: make[source]() for source in sources if source in make}
        key = {name: identity[name] for name in ("checkpoint", "seed", "start", "blend") if name in identity}
        store = ChunkStore(chunks, self.env.num_envs, {"format": _FORMAT, "clips": self.clips, **key})
        commander = Commander(self.env.library, self.labelled, self.encodes)
        recorders: dict[str, Recorder] = {
            source: Player(self.env, agent, commander, request.start) for source, agent in agents.items()
        }
        if REPLAYED in sources:
            recorders[REPLAYED] = Replayer(self.env.character, self.env.library, self.scene.states)
        gather(store, recorders, _protocols(self.metrics), request.trajectories, request.seed, self.scene)
        return Measured(identity, *self._judge(sources, agents, store))

    def _judge(
        self, sources: tuple[str, ...], agents: dict[str, Any], store: ChunkStore
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """What each metric found on each source, and its curves."""
        found = {metric.name: _blank(metric) for metric in self.metrics}
        curves: dict[str, Any] = {metric.name: {} for metric in self.metrics}
        with make_display(len(sources) * len(self.metrics)) as display:
            for source in sources:  # one after the other: the windows of 10,000 trajectories are 150 MB
                gathered = {
                    protocol.name: collect(store, source, protocol, self.request.trajectories)
                    for protocol in _protocols(self.metrics)
                    if responds(source, protocol)
                }
                diverged = {name: count for name, (_, count) in gathered.items()}
                digests = {name: kept for name, (kept, _) in gathered.items()}
                evidence = Evidence(self.scene, source, agents.get(source), digests)
                for metric in self.metrics:
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


@contextmanager
def open_bench(config: TrainConfig, folder: Path, request: Request) -> Iterator[Bench]:
    """The bench of a run, whose worlds are closed in the end.

    Raises:
        CommandError: a metric that there is not, or that this run's agent cannot give.
        SuiteError: the clips cannot be used.
    """
    env = _environment(config, request.motions or config.env.motions, min(request.trajectories, CHUNK))
    try:
        has = _abilities(config, env)
        metrics, left_out = choose(request.metrics, has)
        encodes = ENCODER in has
        labelled = COMMANDS in has and not encodes
        scene = Scene(env.character, env.library, request.seed, labelled)
        clips = clip_digests(env.library.clips)
        yield Bench(config, folder, request, env, scene, clips, metrics, left_out, labelled, encodes)
    finally:
        env.close()


def _environment(config: TrainConfig, motions: str, worlds: int) -> HumanoidVectorEnv:
    """Worlds that nothing ends; the ground alone counts as touched."""
    changed = {"motions": motions, "autoreset": "disabled", "episode_steps": _ENDLESS, "fall": FallConfig()}
    return HumanoidVectorEnv(worlds, dataclasses.replace(for_playing(config.env), **changed))


def _abilities(config: TrainConfig, env: HumanoidVectorEnv) -> set[str]:
    """The keys of `NEEDS` that this run's agent can give.

    Raises:
        CommandError: nobody else can choose its latents, so that no protocol can be followed.
    """
    name = config.choices["agent"]
    agent, _ = make_agent(name, config.agent, env, config.seed)
    if not isinstance(agent, Steerable):
        raise CommandError(f"agent={name}: takes no latents from outside, and cannot be evaluated")
    encodes = hasattr(agent, "encode")
    told = encodes or (AGENTS[name].labelled and len(env.skills) > 1)
    able = {COMMANDS: told, ENCODER: encodes, RESIDUAL: config.env.residual_force > 0}
    return {need for need, given in able.items() if given}


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
