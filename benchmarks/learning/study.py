"""A learning study: one set of clips, some settings, some seeds. Runs what is missing and keeps the curves.

    python benchmarks/learning/study.py discount             # docs/learning/discount.json and discount.png
    python benchmarks/learning/study.py discount --seeds 1   # one seed first

Its runs lie in runs/learning/discount/. A study is a file of `studies/`; its task is a line of `tasks.yaml`; with
`measured_every` a checkpoint is kept every so many samples, and what each covers and obeys is measured in the end. Stop
it at any time: the same command goes on.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import yaml
from results import collect, plot

from murmillo.cli.runs import LAST, MEASURES, METRICS, SCALARS

HERE = Path(__file__).parent
RUNS = Path("runs/learning")
RESULTS = HERE.parents[1] / "docs" / "learning"
ADAPTNET = "agent=adaptnet"
ALONG = ("metrics=[coverage,controllability]", "checkpoint=all", "start=reference", "worlds=0")
"""What is measured of the checkpoints that a run kept on its way."""
TRAJECTORIES = 200


@dataclass(frozen=True)
class Study:
    """
    Attributes:
        name: of its file.
        question: that it answers.
        seeds: of each variant.
        words: for `murmillo train`, of all runs; the task's and the number of samples among them.
        variants: further words of each variant by its name.
        measured_every: samples between the checkpoints that are kept and measured, or None.
    """

    name: str
    question: str
    seeds: tuple[int, ...]
    words: tuple[str, ...]
    variants: dict[str, tuple[str, ...]]
    measured_every: int | None = None

    def words_of(self, variant: str, seed: int) -> list[str]:
        """The words of one run, but for where it is kept."""
        return [*self.words, *self.variants[variant], f"seed={seed}"]

    def folders(self, variant: str) -> list[Path]:
        """Its runs that have made an iteration, by seed."""
        logs = (RUNS / self.name).glob(f"*/{SCALARS}")
        found = [log.parent for log in logs if re.fullmatch(rf"{re.escape(variant)}-\d+", log.parent.name)]
        return sorted(found, key=seed_of)


def seed_of(folder: Path) -> int:
    """The seed of a run, the end of its name."""
    return int(folder.name.rpartition("-")[2])


def read(name: str) -> Study:
    """The study of this name. Exits with a line where there is none, or its file has not what a study needs."""
    file = HERE / "studies" / f"{name}.yaml"
    if not file.is_file():
        known = ", ".join(sorted(path.stem for path in file.parent.glob("*.yaml")))
        sys.exit(f"study {name}: there is no such file in {file.parent}; there are: {known}")
    content = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
    if missing := [key for key in ("question", "task", "samples", "variants") if not content.get(key)]:
        sys.exit(f"{file}: {missing[0]} is missing; a study has question, task, samples and variants")
    tasks = yaml.safe_load((HERE / "tasks.yaml").read_text(encoding="utf-8"))
    if content["task"] not in tasks:
        sys.exit(f"{file}: task: {content['task']} is no line of tasks.yaml; there are: {', '.join(tasks)}")
    common = (
        *tasks[content["task"]],
        f"runner.samples={content['samples']}",
        "runner.max_minutes=null",
        *content.get("words", ()),
    )
    variants = {str(variant): tuple(words) for variant, words in content["variants"].items()}
    seeds = tuple(content.get("seeds", (1, 2, 3)))
    return Study(name, content["question"], seeds, common, variants, content.get("measured_every"))


def run(study: Study, variant: str, seed: int) -> bool:
    """Train one run, from where it stopped if it was begun; whether it is there to its end."""
    name = f"{variant}-{seed}"
    folder = RUNS / study.name / name
    words = study.words_of(variant, seed)
    asked = folder.with_name(f"{name}.json")
    if folder.exists() and (not asked.exists() or json.loads(asked.read_text(encoding="utf-8")) != words):
        sys.exit(f"{folder}: was made with other settings; move it away, or give the variant another name")
    if (folder / MEASURES).exists():
        return _measured(study, folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    if (folder / LAST).exists():
        words = [f"run.resume={folder}"]
    else:
        shutil.rmtree(folder, ignore_errors=True)  # it ended before there was a checkpoint to go on from
        asked.write_text(json.dumps(words), encoding="utf-8")
        words += [f"run.root={folder.parent}", f"run.name={name}", "run.video=false"]
        words += [] if ADAPTNET in words else ["run.evaluate=false"]  # its runs know no such setting
        words += [] if study.measured_every is None else [f"run.keep_every={study.measured_every}"]
    print(f"{study.name}: {name}", flush=True)
    ended = murmillo(["train", *words]) == 0 and (folder / MEASURES).exists()
    return ended and _measured(study, folder)


def _measured(study: Study, folder: Path) -> bool:
    """Measure what the study asks of the checkpoints that the run kept, unless it is done; whether it is."""
    if study.measured_every is None or (folder / METRICS).exists():
        return True
    return murmillo(["evaluate", f"run={folder}", *ALONG, f"trajectories={TRAJECTORIES}"]) == 0


def murmillo(words: list[str]) -> int:
    """The exit status of `murmillo` with these words; Ctrl-C reaches it too, and it is let save what it has."""
    with subprocess.Popen([sys.executable, "-m", "murmillo.cli.main", *words]) as command:
        try:
            return command.wait()
        except KeyboardInterrupt:
            command.wait()
            raise


def main(words: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", help="of a file in studies/")
    parser.add_argument("--seeds", type=int, nargs="+", help="instead of the study's own")
    asked = parser.parse_args(words)
    study = read(asked.name)
    try:
        ended = [run(study, variant, seed) for seed in asked.seeds or study.seeds for variant in study.variants]
    except KeyboardInterrupt:
        sys.exit("stopped; the same command goes on")
    folders = {variant: study.folders(variant) for variant in study.variants}
    if not any(folders.values()):
        sys.exit(f"study {study.name}: no run has made an iteration; what was wrong is said above")
    results = collect(study, folders)
    RESULTS.mkdir(parents=True, exist_ok=True)
    file = RESULTS / f"{study.name}.json"
    file.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    print(", ".join(map(str, [file, *plot(results, file.with_suffix(".png"))])))
    if not all(ended):
        sys.exit("some runs have not ended; the same command goes on with them")


if __name__ == "__main__":
    main()
