"""Labels from a file that a person wrote: JSON, YAML or CSV, a label for each name of a clip."""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip
from murmillo.envs.motion.reading import parse_yaml, read_bytes

_FORMS = 'JSON or YAML that maps names to labels, {"walk_01": "walk"}, or CSV lines, walk_01,walk'


def from_file(clips: Sequence[Clip], file: str | Path) -> list[Clip]:
    """The clips with the labels that a file gives to their names; it may name other clips besides.

    Raises:
        MotionError: a file that cannot be read, or has no label for a clip.
    """
    labels = read_labels(file)
    return [replace(clip, label=_label_of(clip.name, labels, file)) for clip in clips]


def read_labels(file: str | Path) -> dict[str, str]:
    """Labels by name of clip, from a .json, .yaml, .yml or .csv file.

    Raises:
        MotionError: it is missing, or holds no names with labels.
    """
    file = Path(file)
    readers = {".json": json.loads, ".yaml": parse_yaml, ".yml": parse_yaml, ".csv": _read_csv}
    read = readers.get(file.suffix.lower())
    if read is None:
        raise MotionError(f"{file}: is no file of labels; give {_FORMS}")
    data = read_bytes(file)
    try:
        content: Any = read(data.decode("utf-8-sig"))
    except (ValueError, RecursionError, csv.Error):
        raise MotionError(f"{file}: cannot be understood; give {_FORMS}") from None
    if not isinstance(content, dict) or not content:
        raise MotionError(f"{file}: holds no labels; give {_FORMS}")
    for name, label in content.items():
        if not all(isinstance(text, str) and text and text.isprintable() for text in (name, label)):
            raise MotionError(
                f"{file}: {str(name)[:40]!a} has the label {str(label)[:40]!a}; give names and labels as text"
            )
    return content


def _read_csv(text: str) -> dict[str, str]:
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text, newline="")) if any(row)]
    if any(len(row) != 2 for row in rows):
        raise ValueError("each line needs a name and a label")
    if rows and rows[0] == ["name", "label"]:
        rows = rows[1:]
    labels = dict(rows)
    if len(labels) != len(rows):
        raise ValueError("a name is listed twice")
    return labels


def _label_of(name: str, labels: Mapping[str, str], file: str | Path) -> str:
    if name in labels:
        return labels[name]
    near = get_close_matches(name, labels, n=1)
    hint = f"; it has {near[0]!a}" if near else ""
    raise MotionError(f"{file}: has no label for the clip {name}{hint}; add a line for it")
