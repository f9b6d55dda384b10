"""From recordings to figures: each metric's function in `murmillo.envs.metrics`, with its spread and its curves."""

from importlib.util import find_spec
from typing import Any

import torch
from torch import Tensor

from murmillo.cli.encodings import encode_clips
from murmillo.cli.evaluation.figures import Outcome, Value, blocked, bootstrapped
from murmillo.cli.evaluation.protocols import PUSHED, SWITCHED, SWITCHED_ASE
from murmillo.cli.evaluation.scene import Evidence, Scene
from murmillo.cli.evaluation.sources import TRAINED
from murmillo.envs.metrics import classifier
from murmillo.envs.metrics import quality as signs
from murmillo.envs.metrics.coverage import filtered_coverage, frequencies
from murmillo.envs.metrics.diversity import average_pairwise_distance, most_diverse, repeated_distance
from murmillo.envs.metrics.frechet import frechet_distance
from murmillo.envs.metrics.latents import class_distances, fisher_concentration
from murmillo.envs.metrics.maps import classical_mds, tsne
from murmillo.envs.metrics.recovery import recovery as recovery_of
from murmillo.envs.metrics.transitions import transition_coverage, transition_matrix

RATES = tuple(rate / 100 for rate in range(0, 51, 5))
"""Filtering rates of the coverage curve (C·ASE, figure 6)."""
_DRAWS = 10
_LEAST_DRAWN = 100
"""Motions in a draw: the mean distance of fewer says more of the draw than of the policy."""
_DIVERSE = 10
_MAPPED = 600
"""Encodings on a map at most: more would lie over each other."""


def coverage(evidence: Evidence) -> Outcome:
    matched, distinct = evidence.held["matched"], evidence.scene.distinct

    def value(rate: float) -> Value:
        if evidence.agent is None:  # clips are replayed in turn, not drawn
            return Value(filtered_coverage(matched, distinct, rate), len(matched))
        return bootstrapped(
            lambda rows: filtered_coverage(matched[rows], distinct, rate), len(matched), evidence.scene.generator()
        )

    values = {"coverage": value(0.0), **{f"coverage_{rate}": value(rate / 100) for rate in (10, 20, 50)}}
    curve = [filtered_coverage(matched, distinct, rate) for rate in RATES]
    return Outcome(values, {"coverage": curve, "frequencies": frequencies(matched, distinct).tolist()})


def transitions(evidence: Evidence) -> Outcome:
    values, curves, distinct = {}, {}, evidence.scene.distinct
    for name, protocol in (("transitions", SWITCHED), ("transitions_ase", SWITCHED_ASE)):
        source, destination = (evidence.digests[protocol.name][part] for part in ("source", "destination"))
        values[name] = Value(transition_coverage(source, destination, distinct), len(source))
        curves[name] = transition_matrix(source, destination, distinct).tolist()
    return Outcome(values, curves)


def frechet(evidence: Evidence) -> Outcome:
    window = evidence.held["window"]
    clips = evidence.scene.reference_windows(len(window))
    if len(window) < 2:
        return Outcome({}, {})
    return Outcome(
        {f"frechet_{f}": Value(frechet_distance(window[:, :f], clips[:, :f]), len(window)) for f in (1, 2, 30)}, {}
    )


def diversity(evidence: Evidence) -> Outcome:
    held, n = evidence.held, len(evidence.held["window"])
    curves = {"paths": _diverse_paths(evidence)}
    if n < 2:
        return Outcome({}, curves)
    if n < _LEAST_DRAWN * _DRAWS:
        return Outcome({"pairwise_distance": Value(average_pairwise_distance(held["window"]), n)}, curves)
    spread = repeated_distance(held["window"], n // _DRAWS, _DRAWS, evidence.scene.generator())
    value = Value(spread.mean, n, spread.deviation, f"{_DRAWS} draws of {n // _DRAWS}")
    return Outcome({"pairwise_distance": value}, curves)


def _diverse_paths(evidence: Evidence) -> list[dict[str, Any]]:
    """Root paths [m, points, 2] of the ten skills whose own are the most diverse, with their names.

    A skill is a label or a clip that was commanded, or the clip that was matched where no one commands.
    """
    scene, held = evidence.scene, evidence.held
    if scene.labelled:
        kind, names = held["skill"], list(scene.library.skills)
    else:
        kind, names = scene.number(held.get("clip", held["matched"])), scene.names
    least = max(2, len(kind) // len(names))
    groups = [rows for rows in ((kind == k).nonzero().flatten() for k in range(len(names))) if len(rows) >= least]
    if not groups:
        return []
    paths = torch.stack([held["path"][rows[:least]] for rows in groups])
    chosen = most_diverse(paths, min(_DIVERSE, len(groups)))
    return [{"name": names[int(kind[groups[i][0]])], "paths": paths[i].tolist()} for i in chosen.tolist()]


def concentration(evidence: Evidence) -> Outcome | None:
    """None for clips, which encode nothing."""
    if evidence.agent is None:
        return None
    latent, clip = encode_clips(evidence.agent, evidence.scene.library)
    clip = evidence.scene.first_alike[clip]
    value = Value(fisher_concentration(latent, clip), len(latent))
    maps = _maps(evidence.scene, latent, clip) if evidence.source == TRAINED else {}
    return Outcome({"concentration": value}, maps)


def _maps(scene: Scene, latent: Tensor, clip: Tensor) -> dict[str, Any]:
    """Where the encodings lie, and how far the clips' are from each other."""
    some = torch.linspace(0, len(latent) - 1, min(_MAPPED, len(latent))).long()
    maps = {
        "clip": scene.number(clip[some]).tolist(),
        "mds": classical_mds(torch.cdist(latent[some], latent[some])).tolist(),
        "distances": class_distances(latent, clip).tolist(),
    }
    if len(some) > 3 and find_spec("sklearn") is not None:
        maps["tsne"] = tsne(latent[some], scene.seed).tolist()
    return maps


def inception(evidence: Evidence) -> Outcome:
    p = evidence.scene.probabilities(evidence.held["window"])
    trained = evidence.scene.classifier
    score = bootstrapped(lambda rows: classifier.inception_score(p[rows]), len(p), evidence.scene.generator())
    accuracy = Value(trained.held_out_accuracy, trained.held_out_windows)
    return Outcome({"inception": score, "classifier_accuracy": accuracy}, {})


def controllability(evidence: Evidence) -> Outcome:
    """How much is seen as what was commanded, and as the curves "names" and "seen" what each command is seen as."""
    scene, held = evidence.scene, evidence.held
    p = scene.probabilities(held["window"])
    if scene.labelled:
        commanded = held["skill"]
        skills = len(scene.library.skills)
        label = torch.cat((scene.library.clip_skill[torch.tensor(scene.distinct)], torch.tensor([skills])))
        p = torch.zeros(len(p), skills + 1).index_add_(1, label, p)
        names = list(scene.library.skills)
    else:
        commanded, names = scene.number(held["clip"]), scene.names
    return Outcome(
        {
            "controllability": bootstrapped(
                lambda rows: classifier.controllability(p[rows], commanded[rows]), len(p), scene.generator()
            )
        },
        {"names": names, "seen": classifier.confusion(p, commanded, len(names)).tolist()},
    )


def residual(evidence: Evidence) -> Outcome | None:
    """None for clips, which nothing drives."""
    if "residual_force" not in evidence.held:
        return None
    force, torque = evidence.held["residual_force"], evidence.held["torque"]
    joints = [joint.action for joint in evidence.scene.character.joints]
    share = blocked(lambda rows: signs.residual_share(force[rows], torque[rows], joints), len(force))
    return Outcome({"residual_share": share}, {})


def quality(evidence: Evidence) -> Outcome:
    held = evidence.held
    foot, touching, key = held["foot_pos_w"], held["touching"], held["key_pos_w"]
    values = {
        "foot_slide": blocked(lambda rows: signs.foot_slide(foot[rows], touching[rows]), len(foot)),
        "jerk": blocked(lambda rows: signs.jerk(key[rows]), len(key)),
    }
    if "torque" in held:
        torque, velocity, fallen = held["torque"], held["velocity"], held["fallen"]
        values["power"] = blocked(lambda rows: signs.power(torque[rows], velocity[rows]), len(torque))
        values["on_ground"] = blocked(lambda rows: _share(fallen[rows]), len(fallen))
    return Outcome(values, {})


def recovery(evidence: Evidence) -> Outcome | None:
    """None for clips, which do not feel a push."""
    if PUSHED.name not in evidence.digests:
        return None
    pushed = evidence.digests[PUSHED.name]
    found = recovery_of(pushed["root_height"], pushed["head_height"], pushed["fallen"])
    deviation = found.time_s.std().item() if len(found.time_s) > 1 else None
    values = {
        "recovered": Value(found.share, found.fell),
        "recovery_mean": Value(found.mean_s, len(found.time_s), deviation, "single recoveries"),
        "recovery_max": Value(found.max_s, len(found.time_s)),
        "fell": Value(found.fell / found.trials, found.trials),
    }
    return Outcome(values, {"recovery_times": found.time_s.tolist()})


def _share(marked: Tensor) -> float:
    return marked.double().mean().item()
