"""What the AdaptNet paper reports."""

IMITATION_ERROR = {
    "swaggering": 0.05,
    "goose_step": 0.11,
    "stomp": 0.08,
    "kicking": 0.08,
    "stoop": 0.07,
    "jaunty": 0.16,
    "sashay": 0.06,
    "limp": 0.10,
    "pace": 0.09,
    "penguin": 0.11,
    "strutting": 0.09,
    "joyful": 0.17,
}
"""Imitation error [m] of AdaptNet by style (table 2, first column)."""
_OTHER_NAMES = {"swagger": "swaggering", "goose": "goose_step", "kick": "kicking", "strut": "strutting"}


def imitation_error(clip: str) -> float | None:
    """The paper's imitation error [m] of the style that a clip is called like, if it has one: jaunty, jaunty_skip."""
    words = clip.lower()
    for name in (*IMITATION_ERROR, *_OTHER_NAMES):
        if words == name or words.startswith(f"{name}_"):
            return IMITATION_ERROR[_OTHER_NAMES.get(name, name)]
    return None
