"""What CALM reports of its machines: success rates of table 2."""

from murmillo.cli.machines.files import Chosen

_LOCATION = {
    "run_forward": {"guard": 0.98, "roar": 0.99, "block_crouched": 0.96},
    "walk_forward": {"guard": 0.99, "roar": 1.00, "block_crouched": 0.97},
    "crouch_walk": {"guard": 0.98, "roar": 0.99, "block_crouched": 0.97},
}
"""By style and ending: stand idle, celebrate with arms up, crouch idle."""
_STRIKE = {
    "run_forward": {"kick": 0.96, "shield_charge": 1.00, "slash_left": 0.99},
    "walk_forward": {"kick": 0.98, "shield_charge": 1.00, "slash_left": 0.96},
    "crouch_walk": {"kick": 0.99, "shield_charge": 0.99, "slash_left": 0.99},
}
"""By style and attack: kick, shield charge, sword swipe."""
_RATES = {"location": ("ending", _LOCATION), "strike": ("attack", _STRIKE)}


def published_rate(chosen: Chosen) -> float | None:
    """The success rate for a shipped machine's style and what it ends in, told by the clips that stand for these.

    In another simulator, with other clips and after 5e9 samples. None where the paper has none.
    """
    if chosen.word not in _RATES:
        return None
    what, rates = _RATES[chosen.word]
    style, end = chosen.parameters["style"], chosen.parameters[what]
    return rates.get(str(style), {}).get(str(end))
