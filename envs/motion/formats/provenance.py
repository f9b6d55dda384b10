"""Whose a recording is and what its licence allows, where a file beside it says so in a way that cannot be misread."""

import re
from dataclasses import dataclass
from pathlib import Path

_NAMES = ("license", "licence", "copying", "readme")
"""A file with a licence's name counts for more than one that just mentions it."""
_MAX_BYTES = 2**16
_CC_PARTS = r"(?P<nc>[ -](?:NC|NonCommercial))?(?P<end>[ -](?:ND|NoDerivs|NoDerivatives|SA|ShareAlike))?"
_CREATIVE_COMMONS = re.compile(
    rf"\b(?:CC[ -]BY|Attribution){_CC_PARTS}[ -](?:\(CC[^)]*\) )?(?P<version>\d\.0)\b", re.IGNORECASE
)
_OTHERS = {
    "CC0-1.0": re.compile(r"\bCC0\b", re.IGNORECASE),
    "MIT": re.compile(r"\bMIT Licen[cs]e\b", re.IGNORECASE),
    "Apache-2.0": re.compile(r"\bApache Licen[cs]e,?\s+Version 2\.0\b", re.IGNORECASE),
}
_COPYRIGHT = re.compile(r"Copyright +(?:\([cC]\) *|© *)?\d{4}[^\r\n]{0,80}")
_FREE = re.compile(r"CC0-1\.0|MIT|Apache-2\.0|CC-BY-\d\.0")
_RESTRICTED = re.compile(r"\bnon-?\s?commercial|\bresearch\s+(?:use|purposes?)\s+only", re.IGNORECASE)
"""No free licence has such words: beside one, they are about a part of the files."""


@dataclass(frozen=True)
class Provenance:
    """The licence of the files in a folder, as an SPDX name, and who says so; "unknown" where nobody surely does."""

    source: str = "unknown"
    licence: str = "unknown"

    @property
    def redistributable(self) -> bool:
        """Whether the licence surely lets the recordings, and what is made of them, be passed on by anybody."""
        return _FREE.fullmatch(self.licence) is not None


def find_provenance(folder: Path) -> Provenance:
    """What the licence in this folder says; where there is none, its read-me, if that names one licence only."""
    try:
        files = sorted(file for file in folder.iterdir() if file.stem.lower() in _NAMES and file.is_file())
    except OSError:
        return Provenance()
    if not files:
        return Provenance()
    file = min(files, key=lambda file: _NAMES.index(file.stem.lower()))
    text = _read(file)
    licences = _licences(text)
    # the text of one licence may mention others, but begins with its own name
    if not licences or (file.stem.lower() == "readme" and len(set(licences)) > 1):
        return Provenance()
    if _FREE.fullmatch(licences[0]) and _RESTRICTED.search(text):
        return Provenance()
    owner = _COPYRIGHT.search(text)
    source = owner[0].strip() if owner and owner[0].isprintable() else folder.name
    return Provenance(source or "unknown", licences[0])


def _read(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            return stream.read(_MAX_BYTES).decode("utf-8", errors="replace")
    except OSError:
        return ""


def _licences(text: str) -> list[str]:
    """The licences that the text names, in its order."""
    text = re.sub(r"\s+", " ", text)
    found = [(match.start(), name) for name, pattern in _OTHERS.items() if (match := pattern.search(text))]
    for match in _CREATIVE_COMMONS.finditer(text):
        noncommercial = "-NC" if match["nc"] else ""
        end = {"n": "-ND", "s": "-SA"}[match["end"][1].lower()] if match["end"] else ""
        found.append((match.start(), f"CC-BY{noncommercial}{end}-{match['version']}"))
    return [name for _, name in sorted(found)]
