"""The regression gate: `python -m benchmarks.gate compare` holds a run against the baseline, `baseline` writes it.

Both hold ratios of what ran in turns on one machine, not seconds, so that a slower machine is no regression. More is
better in all of them.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.record import FOLDER, JSON
from murmillo.cli.errors import CommandError
from murmillo.cli.runs import write_json

BASELINE = Path("benchmarks/baseline.json")
FALL = 0.15
"""The part of a ratio that may be lost."""
BUSY = 0.25
"""Load a core above which a machine is not idle."""


def compare(baseline: Mapping[str, Any], results: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    """Hold the ratios of a run against those of the baseline.

    Args:
        baseline: `machine`, `median`, `low` and `high` by the name of a ratio.
        results: a run's JSON (`Record.as_json`).

    Returns:
        A line for each failure, which is a ratio that has fallen by more than `FALL` or is missing without a reason;
        and a line for each thing to know.
    """
    failures, notes = [], []
    measured = results["ratios"]
    for name, kept in baseline.items():
        if name not in measured:
            reason = results["left_out"].get(name)
            if reason is None:
                failures.append(f"{name}: missing; it is in the baseline, but this run has not measured it")
            else:
                notes.append(f"{name}: left out, {reason}")
            continue
        fall = 1 - measured[name]["median"] / kept["median"]
        if fall > FALL:
            now, then = _spread(measured[name]), f"{_spread(kept)} of {kept['machine']}"
            failures.append(f"{name}: {now}, {fall:.0%} below the baseline's {then}")
    notes += [f"{name}: not in the baseline" for name in measured if name not in baseline]
    return failures, notes


def renewed(baseline: Mapping[str, Any], results: Mapping[str, Any]) -> dict[str, Any]:
    """The baseline with the ratios of a run in place of its own; what the run could not measure stays."""
    machine = machine_of(results)
    return {**baseline, **{name: {**ratio, "machine": machine} for name, ratio in results["ratios"].items()}}


def machine_of(results: Mapping[str, Any]) -> str:
    """Processor, cores and GPU, in words."""
    machine = results["machine"]
    return f"{machine['processor']}, {machine['cores']} cores" + (f", {machine['gpu']}" if machine["gpu"] else "")


def main(words: Sequence[str]) -> int:
    """The exit status: 0 passed or written, 1 fallen, 2 nothing to compare."""
    try:
        if words == ["compare"]:
            return _compare()
        if words == ["baseline"]:
            return _renew()
        raise CommandError("usage: python -m benchmarks.gate compare | baseline")
    except CommandError as error:
        print(f"gate: {error}", file=sys.stderr)
        return 2


def _compare() -> int:
    baseline = _read(BASELINE, "write one on an idle machine: make bench-baseline")
    failures, notes = compare(baseline, _results())
    for line in notes:
        print(f"gate: {line}")
    for line in failures:
        print(f"gate: FAILED: {line}")
    if not failures:
        print(f"gate: passed, {len(baseline)} ratios, none more than {FALL:.0%} below the baseline")
    return 1 if failures else 0


def _renew() -> int:
    results = _results()
    cores = results["machine"]["cores"]
    if results["load"] > BUSY * cores:
        print(
            f"gate: warning: the machine was not idle (load {results['load']:.1f} on {cores} cores before the run)",
            file=sys.stderr,
        )
    kept = json.loads(BASELINE.read_text(encoding="utf-8")) if BASELINE.exists() else {}
    write_json(BASELINE, renewed(kept, results))
    print(f"gate: {BASELINE} has {len(results['ratios'])} ratios of {machine_of(results)}")
    return 0


def _results() -> dict[str, Any]:
    results = _read(FOLDER / JSON, "run the benchmarks first: make bench")
    if results["quick"]:
        raise CommandError(f"{FOLDER / JSON}: a quick trial, whose figures mean nothing; run without --quick")
    return results


def _read(path: Path, cure: str) -> dict[str, Any]:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise CommandError(f"{path}: there is no such file; {cure}") from None
    except ValueError as error:
        raise CommandError(f"{path}: no JSON ({error}); {cure}") from None


def _spread(ratio: Mapping[str, float]) -> str:
    return f"{ratio['median']:.2f} ({ratio['low']:.2f}-{ratio['high']:.2f})"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
