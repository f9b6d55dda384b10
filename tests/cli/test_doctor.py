"""The doctor finds the environment usable, and a back end that is none."""

from collections.abc import Callable

import pytest

from murmillo.cli import doctor, gl, versions


def test_doctor(murmillo: Callable[..., tuple[int, str, str]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "SECONDS", 0.1)
    monkeypatch.setattr(doctor, "WORLDS", 4)
    status, out, err = murmillo("doctor")
    assert status == 0, out + err
    for word in ("python", "mujoco", "OpenGL", "cores", "control steps/s", "murmillo can train here"):
        assert word in out


def test_a_back_end_that_cannot_draw_says_why() -> None:
    reason = gl.why_not("off")
    assert reason
    assert "\n" not in reason


def test_a_chosen_back_end_is_the_only_candidate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert gl.candidates() == ("osmesa",)


def test_versions_name_what_is_installed() -> None:
    found = versions.package_versions()
    assert found["murmillo"] == "0.1.0"
    assert all(found.values())
    assert versions.usable_cores() >= 1
