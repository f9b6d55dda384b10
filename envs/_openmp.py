"""Imports torch with threads that do not wait for work on the cores that MuJoCo's threads need.

After each operation GNU's OpenMP, which torch has on Linux, keeps its threads spinning for some milliseconds. On two
cores that is a fifth of an environment's step (docs/benchmarks.md). It reads how long they may when it is loaded, and
only then; the variable is taken back afterwards, so that other processes of the user choose for themselves.
"""

import os

SPINS = "GOMP_SPINCOUNT"

_choose = SPINS not in os.environ and "OMP_WAIT_POLICY" not in os.environ

if _choose:
    os.environ[SPINS] = "10000"  # a tenth of a millisecond, so that what follows at once finds them awake

import torch  # noqa: E402, F401

if _choose:
    del os.environ[SPINS]
