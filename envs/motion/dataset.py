"""Datasets as ASE and AdaptNet have them: a YAML file that lists motions beside it or below, with weights."""

from pathlib import Path

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.reading import read_yaml

SUFFIXES = (".yaml", ".yml")
_FORM = "motions: [{file: FOLDER/NAME.npy, weight: 1.0}]"


def read_dataset(file: Path) -> dict[Path, float | None]:
    """The files that a dataset lists and their sampling weights, in its order; None where it gives no weight.

    Raises:
        MotionError: no YAML, or an entry without the path of a file in the same folder, or with a weight not above 0.
    """
    content = read_yaml(file, "a dataset", _FORM)
    entries = content.get("motions") if isinstance(content, dict) else None
    if not isinstance(entries, list) or not entries:
        raise MotionError(f"{file}: lists no motions; it should read {_FORM}")
    weights: dict[Path, float | None] = {}
    for i, entry in enumerate(entries):
        name, weight = (entry.get("file"), entry.get("weight")) if isinstance(entry, dict) else (None, None)
        if not isinstance(name, str) or Path(name).is_absolute() or ".." in Path(name).parts or "\0" in name:
            raise MotionError(f"{file}: motions[{i}].file must be the path of a motion in the same folder, or below")
        if weight is not None and not (type(weight) in (int, float) and 0.0 < weight < 1e9):
            raise MotionError(f"{file}: motions[{i}].weight must be a number above 0; correct it or remove the entry")
        if file.parent / name in weights:
            raise MotionError(f"{file}: motions[{i}].file is listed twice; remove one")
        weights[file.parent / name] = None if weight is None else float(weight)
    return weights
