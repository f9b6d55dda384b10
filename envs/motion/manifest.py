"""manifest.json of a folder of clips: what is known of each clip beside its numbers.

{"format": "murmillo-clips/1", "character": "sword_shield", "clips": [
  {"file": "walk.npz", "name": "walk", "label": "walk", "fps": 30.0, "frames": 61, "loop": true, "source": "...",
   "licence": "...", "redistributable": true, "weight": 1.0, "masked": [], "origin": "...",
   "sha256": "..."}]}

`sha256` is that of the clip's own file, `origin` that of the file that it was imported from. Manifests written before
clips could be masked or told their origin lack these fields.
"""

import json
import re
from typing import Any, NoReturn

from murmillo.envs.errors import MotionError
from murmillo.envs.motion.clip import Clip

MANIFEST = "manifest.json"
_FORMAT = "murmillo-clips/1"
_NUMBER = (int, float)
_PLAIN_NAME = re.compile(r"[\w().-]+\.npz", re.ASCII)
_OPTIONAL = {"masked", "origin"}
_FIELDS: dict[str, type | tuple[type, ...]] = {
    "file": str,
    "name": str,
    "label": str,
    "fps": _NUMBER,
    "frames": int,
    "loop": bool,
    "source": str,
    "licence": str,
    "redistributable": bool,
    "weight": _NUMBER,
    "masked": list,
    "origin": str,
    "sha256": str,
}


def entry_of(clip: Clip, file: str, sha256: str) -> dict[str, Any]:
    """What the manifest says of a clip."""
    return {
        "file": file,
        "name": clip.name,
        "label": clip.label,
        "fps": clip.fps,
        "frames": clip.frames,
        "loop": clip.loop,
        "source": clip.source,
        "licence": clip.licence,
        "redistributable": clip.redistributable,
        "weight": clip.weight,
        "masked": list(clip.masked),
        "origin": clip.origin,
        "sha256": sha256,
    }


def write_manifest(character: str, entries: list[dict[str, Any]]) -> bytes:
    """The manifest's text; the same entries give the same bytes."""
    manifest = {"format": _FORMAT, "character": character, "clips": entries}
    return (json.dumps(manifest, indent=1, ensure_ascii=False) + "\n").encode()


def read_manifest(data: bytes, place: str) -> tuple[str, list[dict[str, Any]]]:
    """The character's name and the clips' entries, the form of every field checked.

    Raises:
        MotionError: no JSON, another format, or a field that is missing, unknown or wrong; `place` names the file.
    """
    try:
        manifest = json.loads(data.decode("utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        raise MotionError(f"{place}: is no JSON; copy the folder anew") from None
    if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT:
        raise MotionError(f"{place}: is not of the format {_FORMAT}; save the clips with this version of murmillo")
    character, entries = manifest.get("character"), manifest.get("clips")
    if not isinstance(character, str) or not isinstance(entries, list) or not entries:
        raise MotionError(f"{place}: needs a character and a list of clips; copy the folder anew")
    for i, entry in enumerate(entries):
        wrong = _wrong_fields(entry)
        if wrong:
            raise MotionError(
                f"{place}: clip {i} has missing, unknown or wrong fields: {wrong!a}; copy the folder anew"
            )
    return character, entries


def _wrong_fields(entry: Any) -> str:
    """The names of an entry's fields that are not as they should be."""
    if not isinstance(entry, dict):
        return "all"
    wrong = (set(entry) ^ set(_FIELDS)) - (_OPTIONAL - set(entry))
    for key in set(entry) & set(_FIELDS):
        value, kind = entry[key], _FIELDS[key]
        # bool is an int to Python, but no rate or weight
        fits = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not fits or (kind == _NUMBER and not 0.0 < value < 1e9):
            wrong.add(key)
    if "masked" not in wrong and not all(isinstance(body, str) for body in entry.get("masked", ())):
        wrong.add("masked")
    if "file" not in wrong and not _PLAIN_NAME.fullmatch(entry["file"]):
        wrong.add("file (must be a plain name)")
    return ", ".join(sorted(wrong))[:120]


def _refuse_constant(name: str) -> NoReturn:
    """NaN and infinities, which Python would read from JSON."""
    raise ValueError(name)
