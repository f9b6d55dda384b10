"""The wheel holds every file of the rooms, so that the list of packages in pyproject.toml cannot go stale."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = ("envs", "agents", "viewer", "cli", "conf", "assets")
NOT_SHIPPED = (".md", ".pyc")


def shipped_files(folder: Path) -> set[str]:
    return {
        path.relative_to(folder.parent).as_posix()
        for path in folder.rglob("*")
        if path.is_file() and path.suffix not in NOT_SHIPPED and not path.name.startswith(".")
    }


@pytest.fixture(scope="module")
def wheel_files(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Names in a wheel built from a copy of the rooms: setuptools leaves its build folder where it builds."""
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for room in ROOMS:
        shutil.copytree(ROOT / room, source / room, ignore=shutil.ignore_patterns("__pycache__"))
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(source / "dist"),
        str(source),
    ]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = (source / "dist").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return archive.namelist()


@pytest.mark.parametrize("room", ROOMS)
def test_wheel_holds_the_whole_room(wheel_files: list[str], room: str) -> None:
    in_wheel = {name.removeprefix("murmillo/") for name in wheel_files if name.startswith(f"murmillo/{room}/")}
    assert in_wheel == shipped_files(ROOT / room)


def test_every_package_folder_has_an_init() -> None:
    folders = {path.parent for room in ROOMS for path in (ROOT / room).rglob("*.py")}
    assert [str(folder) for folder in sorted(folders) if not (folder / "__init__.py").exists()] == []


def test_nothing_but_murmillo_is_installed(wheel_files: list[str]) -> None:
    assert {name.split("/")[0].removesuffix(".dist-info").split("-")[0] for name in wheel_files} == {"murmillo"}
    assert "murmillo/__init__.py" not in wheel_files, "murmillo is a namespace package"
    assert any(name.endswith("licenses/LICENSE") for name in wheel_files)
