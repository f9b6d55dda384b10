"""What tasks tell of themselves in figures and places, for rules that are written in them."""

import dataclasses
from math import pi
from typing import Any

import pytest
import torch

from murmillo.envs.character import load_character
from murmillo.envs.physics import Physics, make_physics
from murmillo.envs.scene import Scene
from murmillo.envs.tasks import TASKS, Task

WORLDS = torch.arange(2)


def make(name: str, **arguments: Any) -> tuple[Task, Physics]:
    """A task that has just begun in two worlds, and their physics: the character at the origin, facing x."""
    cls: Any = TASKS[name]
    task = cls(cls.config_type(**arguments)) if cls.config_type else cls()
    character = load_character()
    physics = make_physics(Scene(character, task.edit), len(WORLDS), threads=1)
    task.bind(len(WORLDS), character)
    move(physics, (0.0, 0.0))
    task.reset(WORLDS, physics.state, torch.Generator().manual_seed(0))
    return task, physics


def move(physics: Physics, velocity: tuple[float, float]) -> None:
    """Let both characters move at this velocity [m/s]."""
    qpos, qvel = physics.state.qpos.clone(), torch.zeros_like(physics.state.qvel)
    qpos[:, :2], qvel[:, :2] = 0.0, torch.tensor(velocity)
    qpos[:, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    physics.write(WORLDS, qpos, qvel)


@pytest.mark.parametrize("name", TASKS)
def test_every_task_gives_what_it_says(name: str) -> None:
    task, physics = make(name)
    quantities, places = task.quantities(physics.state), task.places(physics.state)
    assert list(quantities) == list(task.quantity_docs)
    assert list(places) == list(task.place_docs)
    assert all(value.shape == (2,) and value.isfinite().all() for value in quantities.values())
    assert all(place.shape == (2, 2) for place in places.values())
    assert not {"time", "time_in_state"} & quantities.keys()
    kept = {key: value.clone() for key, value in (quantities | places).items()}
    physics.step(torch.zeros(2, task.character.action_dim, dtype=torch.float64))
    assert all(torch.equal(kept[key], value) for key, value in (quantities | places).items()), "a live view"


@pytest.mark.parametrize("name", ["Location", "Relocation"])
def test_the_way_to_a_target(name: str) -> None:
    task: Any
    task, physics = make(name)
    move(physics, (2.0, 1.0))
    target_w = torch.tensor([[3.0, 4.0], [0.0, -2.0]], dtype=torch.float64)
    task.goals["target_w"][:] = target_w
    found = task.quantities(physics.state)
    assert found["distance"].tolist() == pytest.approx([5.0, 2.0])
    assert found["facing"].tolist() == pytest.approx([0.6, 0.0])
    assert found["approach"].tolist() == pytest.approx([2.0, -1.0])
    assert found["speed"].tolist() == pytest.approx([5.0**0.5] * 2)
    assert found["height"].tolist() == pytest.approx(physics.state.qpos[:, 2].tolist())
    assert torch.equal(task.places(physics.state)["target"], target_w)


def test_a_target_that_is_struck() -> None:
    task, physics = make("Strike", near=0.0, far_distance=(7.0, 7.0))
    state = physics.state
    found = task.quantities(state)
    assert found["distance"].tolist() == pytest.approx([7.0, 7.0])
    assert found["target_tilt"].tolist() == pytest.approx([0.0, 0.0], abs=1e-6)
    for world, angle in enumerate((0.3, pi)):
        half = torch.tensor(angle / 2)
        state.prop_qpos[world, 0, 3:] = torch.stack((half.cos(), half.sin(), 0 * half, 0 * half))
        state.prop_qvel[world, 0, :3] = torch.tensor([0.0, 3.0, 4.0])
    found = task.quantities(state)
    assert found["target_tilt"].tolist() == pytest.approx([0.3, pi], abs=1e-6)
    assert found["target_speed"].tolist() == pytest.approx([5.0, 5.0])
    assert torch.equal(task.places(state)["target"], state.prop_qpos[:, 0, :2])


@pytest.mark.parametrize("any_body", [False, True])
def test_a_touch_by_any_body_may_be_no_failure(any_body: bool) -> None:
    task, physics = make("Strike", any_body=any_body)
    force_w = torch.zeros_like(physics.state.hit_force_w)
    force_w[0, 0, task.character.bodies.index("shield")] = 50.0
    touched = dataclasses.replace(physics.state, hit_force_w=force_w)
    assert task.terminated(touched).tolist() == [not any_body, False]
