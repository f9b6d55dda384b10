"""What this machine does with somebody's training, in about a minute."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from typing import Any

from murmillo.cli import versions
from murmillo.cli.adaptation.config import AdaptNetTrainConfig
from murmillo.cli.benching.learning import ITERATION, ROLLOUT, UPDATE, Learning, compose, shrunk
from murmillo.cli.benching.memory import peak_memory
from murmillo.cli.benching.stepping import ENVIRONMENT, PHYSICS, Stepping, make_warm, physics_of, warm_state
from murmillo.cli.benching.turns import Contestant, Rates, one_round, rate_of
from murmillo.cli.config import TrainConfig
from murmillo.cli.devices import for_training
from murmillo.envs.tasks import Task

WORLDS = (64, 256, 1024, 4096)
"""Numbers of worlds that are tried beside the training's own."""
MOST_SAMPLES = 8192
"""An iteration of more is measured on a fraction of its worlds and minibatches: the paper's takes a laptop minutes."""
NOTICEABLE = 1.05
"""What is not faster by this factor is as fast."""
_SAMPLES_A_TURN = 1024


@dataclass(frozen=True)
class Findings:
    """What was found. Rates are medians over turns, a second.

    Attributes:
        training: agent, budget, worlds, threads and samples that were asked for.
        physics: what a control step is, in words.
        fraction: of the worlds and minibatches that the iteration was measured with, as its denominator.
        rates: of the training's own parts, by name.
        worlds: control steps by the number of worlds, with the training's threads.
        threads: control steps by the number of threads, with the training's worlds; empty where a GPU simulates.
        peak_bytes: memory of the process after its iterations.
    """

    training: dict[str, Any]
    physics: str
    fraction: int
    rates: dict[str, float]
    worlds: dict[int, float]
    threads: dict[int, float]
    peak_bytes: int

    @property
    def hours(self) -> float:
        """That the training's samples take."""
        return self.training["samples"] / self.rates[ITERATION] / 3600

    def as_json(self) -> dict[str, Any]:
        return {
            "machine": versions.machine(),
            "packages": versions.package_versions(),
            **asdict(self),
            "fastest": {
                "num_envs": fastest(self.worlds, self.training["num_envs"]),
                "threads": fastest(self.threads, self.training["threads"]),
            },
            "hours": self.hours,
        }


def fastest(rates: dict[int, float], own: int) -> int:
    """The number with the highest rate; one's own where no other is noticeably faster."""
    best = max(rates, key=lambda number: rates[number], default=own)
    return best if rates and rates[best] > NOTICEABLE * rates[own] else own


def doubling(most: int) -> list[int]:
    """1, 2, 4, … and `most`."""
    return [2**power for power in range(most.bit_length()) if 2**power < most] + [most]


def measure(words: list[str], seconds: float, say: Callable[[str], None]) -> Findings:
    """Measure the training that these words of `murmillo train` ask for.

    Args:
        words: settings.
        seconds: to measure for, beside what it takes to set up; a slow machine takes longer.
        say: told what is being done.

    Raises:
        CommandError, SuiteError, AgentError: a setting that is not there or cannot be.
    """
    config = compose(words)
    threads = config.threads or versions.usable_cores()
    fraction = 1
    while config.num_envs * config.runner.horizon // fraction > MOST_SAMPLES:
        fraction *= 2
    say("training" if fraction == 1 else f"training, on 1/{fraction} of its worlds and minibatches")
    with closing(Learning(config if fraction == 1 else compose(words + shrunk(config, fraction)))) as learning:
        learning.warm_up()
        rounds = _rounds([learning], seconds / 3)
        physics, on_gpu = physics_of(learning.env), learning.env.state.qpos.is_cuda
    rates = {name: rate_of(rounds, name) for name in (ROLLOUT, UPDATE, ITERATION)}
    peak = peak_memory()

    sizes = sorted({*WORLDS, config.num_envs})
    say(f"environments of {', '.join(map(str, sizes))} worlds")
    state = warm_state(config.env, _task(config))
    by_worlds = _step(config, state, [(size, threads) for size in sizes], seconds / 3)
    by_threads = {}
    if not on_gpu:
        counts = sorted({*doubling(versions.usable_cores()), threads})
        say(f"threads: {', '.join(map(str, counts))}")
        by_threads = _step(config, state, [(config.num_envs, count) for count in counts], seconds / 3)
    return Findings(
        {
            "agent": config.choices["agent"],
            "budget": config.choices["budget"],
            "num_envs": config.num_envs,
            "threads": threads,
            "samples": config.runner.samples,
            "max_minutes": config.runner.max_minutes,
        },
        physics,
        fraction,
        by_worlds[config.num_envs, threads] | rates,
        {size: found[ENVIRONMENT] for (size, _), found in by_worlds.items()},
        {count: found[ENVIRONMENT] for (_, count), found in by_threads.items()},
        peak,
    )


def _step(
    config: TrainConfig | AdaptNetTrainConfig,
    state: Mapping[str, Any],
    cases: Sequence[tuple[int, int]],
    seconds: float,
) -> dict[tuple[int, int], dict[str, float]]:
    """Rates of physics and environment in turns, by numbers of worlds and threads."""
    contestants = []
    for worlds, threads in cases:
        env = make_warm(worlds, dataclasses.replace(for_training(config.env), threads=threads), _task(config), state)
        contestants.append(Stepping(env, max(1, _SAMPLES_A_TURN // worlds), f", {worlds} worlds, {threads} threads"))
    rounds = _rounds(contestants, seconds)
    found = {
        case: {name: rate_of(rounds, name + contestant.label) for name in (PHYSICS, ENVIRONMENT)}
        for case, contestant in zip(cases, contestants, strict=True)
    }
    for contestant in contestants:
        contestant.close()
    return found


def _task(config: TrainConfig | AdaptNetTrainConfig) -> Task | None:
    """What its environment is made with, anew for each; None is imitation."""
    return config.make_task() if isinstance(config, AdaptNetTrainConfig) else None


def _rounds(contestants: Sequence[Contestant], seconds: float) -> list[Rates]:
    """Rounds until the time is up, at least one."""
    done: list[Rates] = []
    end = time.monotonic() + seconds
    while not done or time.monotonic() < end:
        done.append(one_round(contestants))
    return done
