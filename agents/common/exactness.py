"""How exact products of float32 matrices are while a run learns: torch's own setting, and who may round by it."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

AUTO = "auto"
WORDS = {"highest": "highest", "tf32": "high", "bf16": "medium"}
"""Torch's words (`torch.set_float32_matmul_precision`) for ours."""

_UNITS = ("avx512_bf16", "amx_bf16")


def choose(how: str, device: torch.device) -> str:
    """One of `WORDS` for it or "auto", which is bf16 on a processor that has units for it and exact elsewhere."""
    if how != AUTO:
        return how
    able = getattr(torch.cpu, "get_capabilities", dict)() if device.type == "cpu" else {}
    return "bf16" if any(able.get(unit) for unit in _UNITS) else "highest"


@contextmanager
def exactness(how: str) -> Iterator[None]:
    """Within, torch's products of float32 matrices are as exact as this one of `WORDS` says."""
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision(WORDS[how])
    try:
        yield
    finally:
        torch.set_float32_matmul_precision(before)


def rounded(device: torch.device) -> torch.autocast:
    """Within, fully connected layers multiply in bfloat16 where torch may ("medium"), and exactly elsewhere.

    Torch takes leave to round on a GPU only: on a processor its layers stay exact unless they are cast. This is for
    discriminators, whose logits need no more than two digits; a policy's mean does beside a noise of 0.02.
    """
    return torch.autocast(device.type, torch.bfloat16, torch.get_float32_matmul_precision() == WORDS["bf16"])
