"""Which seeds every generator takes: numpy's none below 0, torch's none above 64 bits."""

from murmillo.cli.errors import CommandError

LARGEST = 2**63 - 1


def check_seed(name: str, seed: int) -> None:
    """Refuse a seed that a generator would stumble over.

    Raises:
        CommandError: it is out of range; `name` is how the user has written it, "seed" or "--seed".
    """
    if not 0 <= seed <= LARGEST:
        raise CommandError(f"{name}={seed}: needs an integer from 0 to 2**63 - 1")
