"""Falls by hand: which touch, how hard, and which body low."""

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from murmillo.envs.character import Character, load_character
from murmillo.envs.falls import FallConfig, FallDetector


@pytest.fixture(scope="module")
def character() -> Character:
    return load_character()


def state(character: Character, force: dict[str, float], height: dict[str, float]) -> Any:
    """One world whose bodies are 1 m up and touch nothing, but for these vertical forces [N] and heights [m]."""
    forces, positions = torch.zeros(1, len(character.bodies), 3), torch.ones(1, len(character.bodies), 3)
    for body, value in force.items():
        forces[0, character.bodies.index(body), 2] = value
    for body, value in height.items():
        positions[0, character.bodies.index(body), 2] = value
    return SimpleNamespace(ground_force_w=forces.double(), body_pos_w=positions.double())


@pytest.mark.parametrize(
    ("force", "height", "falls"),
    [
        ({"pelvis": 5.0}, {"pelvis": 0.14}, True),
        ({"pelvis": -5.0}, {"pelvis": 0.14}, True),
        ({"right_hand": 5.0}, {"torso": 0.14}, True),  # another body is low
        ({"pelvis": 0.09}, {"pelvis": 0.14}, False),  # no touch
        ({"pelvis": 5.0}, {"pelvis": 0.16}, False),  # not low
        ({}, {"pelvis": 0.0}, False),
        ({"right_foot": 500.0}, {"pelvis": 0.14}, False),  # a foot may touch
        ({"pelvis": 5.0}, {"right_foot": 0.05}, False),  # and be low
        ({"pelvis": 5.0}, {"head": 0.29}, True),  # the exceptions
        ({"pelvis": 5.0}, {"head": 0.31}, False),
        ({"pelvis": 5.0}, {"left_lower_arm": 0.31}, True),
        ({"pelvis": 5.0}, {"right_lower_arm": 0.31}, False),
    ],
)
def test_a_fall_is_a_touch_and_a_low_body(
    character: Character, force: dict[str, float], height: dict[str, float], falls: bool
) -> None:
    assert FallDetector(character, FallConfig())(state(character, force, height)).tolist() == [falls]


@pytest.mark.parametrize(("body", "falls"), [("sword", True), ("left_foot", False)])
def test_a_touch_alone_can_be_made_a_fall(character: Character, body: str, falls: bool) -> None:
    detector = FallDetector(character, FallConfig())
    detector.touch_is_fall = True
    assert detector(state(character, {body: 5.0}, {})).tolist() == [falls]
