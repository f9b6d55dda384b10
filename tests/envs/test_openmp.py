"""How long torch's threads wait for work: too long, and they keep MuJoCo's from theirs."""

import os
import subprocess
import sys

import pytest

COMMAND = "import sys; from murmillo.cli.main import main; sys.exit(main(['bench', '--no-such-option']))"


def spins(code: str, **variables: str) -> str | None:
    """What OpenMP says of it when it is loaded; None where that is not GNU's."""
    mine = {name: value for name, value in os.environ.items() if name not in ("GOMP_SPINCOUNT", "OMP_WAIT_POLICY")}
    env = mine | {"OMP_DISPLAY_ENV": "VERBOSE"} | variables
    said = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False).stderr
    found = [line.split("'")[1] for line in said.splitlines() if "GOMP_SPINCOUNT" in line]
    return found[0] if found else None


@pytest.fixture(scope="module")
def usual() -> str:
    """What torch has by itself."""
    if (found := spins("import torch")) is None:
        pytest.skip("torch's OpenMP is not GNU's here")
    return found


@pytest.mark.parametrize("code", ["import murmillo.envs", COMMAND])
def test_torch_is_loaded_with_threads_that_soon_sleep(usual: str, code: str) -> None:
    assert int(spins(code) or usual) < int(usual) / 10


def test_what_the_user_has_set_stays(usual: str) -> None:
    assert spins("import murmillo.envs", GOMP_SPINCOUNT="777") == "777"
    assert spins("import murmillo.envs", OMP_WAIT_POLICY="active") == spins("import torch", OMP_WAIT_POLICY="active")


def test_other_processes_of_the_user_choose_for_themselves() -> None:
    code = "import os, murmillo.envs; print('GOMP_SPINCOUNT' in os.environ)"
    env = {name: value for name, value in os.environ.items() if name != "GOMP_SPINCOUNT"}
    said = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert said.stdout == "False\n"
