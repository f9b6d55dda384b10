"""Focal skill sampling by hand."""

import pytest
import torch

from murmillo.agents.case.focal import FocalSampling, hardness
from tests.agents.toy import small_case

T = torch.tensor


def focal(skills: int, **changes: object) -> FocalSampling:
    return FocalSampling(skills, small_case(**changes))


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ("paper", [1 - 0.1 / 0.8, 1 - 0.3 / 0.8, 1 - 0.4 / 0.8]),
        ("normalised", [0.9 / 2.2, 0.7 / 2.2, 0.6 / 2.2]),
        ("code", [1 - 0.9 / 2.2, 1 - 0.7 / 2.2, 1 - 0.6 / 2.2]),
    ],
)
def test_forms_by_hand(form: str, expected: list[float]) -> None:
    assert hardness(T([0.1, 0.3, 0.4]), form).tolist() == pytest.approx(expected)


def test_one_update_of_equation_4_by_hand() -> None:
    sampling = focal(2, focal="paper", focal_rate=0.2)
    sampling.update(scores=T([0.1, 0.3, 0.6]), labels=T([0, 0, 1]))  # b = 0.2, 0.6
    assert sampling.score.tolist() == pytest.approx([0.2, 0.6])
    assert sampling.weight.tolist() == pytest.approx([0.8 * 0.5 + 0.2 * 0.75, 0.8 * 0.5 + 0.2 * 0.25])
    assert sampling.probability.tolist() == pytest.approx([0.55, 0.45])


@pytest.mark.parametrize(("form", "harder_gets_more"), [("paper", True), ("normalised", True), ("code", False)])
def test_what_is_hard_is_practised_more_but_for_the_code(form: str, harder_gets_more: bool) -> None:
    sampling = focal(3, focal=form)
    for _ in range(50):
        sampling.update(T([0.05, 0.5, 0.5]), T([0, 1, 2]))
    hard, easy, _ = sampling.probability.tolist()
    assert (hard > easy) == harder_gets_more


def test_with_many_skills_the_papers_form_is_almost_uniform_and_the_normalised_is_not() -> None:
    scores = torch.full((87,), 0.5)
    scores[0] = 0.01
    greatest = {}
    for form in ("paper", "normalised"):
        sampling = focal(87, focal=form)
        for _ in range(100):
            sampling.update(scores, torch.arange(87))
        greatest[form] = sampling.scalars()["greatest"]
    assert greatest["paper"] < 87 / 86 + 1e-4
    assert greatest["normalised"] > 1.9


def test_a_skill_that_nobody_showed_keeps_its_score() -> None:
    sampling = focal(3)
    sampling.update(T([0.1, 0.9]), T([0, 2]))
    assert sampling.score.tolist() == pytest.approx([0.1, 0.5, 0.9])


def test_the_floor_holds() -> None:
    sampling = focal(4, focal="normalised", focal_rate=1.0, focal_floor=0.2)
    sampling.update(T([1.0, 1.0, 1.0, 0.0]), torch.arange(4))
    assert sampling.probability.min() >= 0.2 / 4 / (1 + 3 * 0.2 / 4) - 1e-6
    assert sampling.probability.argmax() == 3


@pytest.mark.parametrize("form", ["paper", "normalised", "code"])
def test_an_only_skill_gets_everything(form: str, generator: torch.Generator) -> None:
    sampling = focal(1, focal=form)
    for _ in range(1000):
        sampling.update(T([1.0]), T([0]))
    assert sampling.probability.tolist() == [1.0]
    assert sampling.draw(5, generator).tolist() == [0] * 5


@pytest.mark.parametrize("changes", [{"focal": "none"}, {"active": False}])
def test_before_it_starts_all_skills_are_drawn_alike(changes: dict) -> None:
    active = changes.pop("active", True)
    sampling = focal(3, **changes)
    sampling.update(T([0.1, 0.5, 0.9]), torch.arange(3), active=active)
    assert sampling.probability.tolist() == pytest.approx([1 / 3] * 3)
    assert sampling.score.tolist() == pytest.approx([0.1, 0.5, 0.9])  # known already when it starts


def test_labels_are_drawn_by_the_shares(generator: torch.Generator) -> None:
    sampling = focal(3)
    sampling.probability = T([0.7, 0.2, 0.1])
    drawn = torch.bincount(sampling.draw(20_000, generator), minlength=3) / 20_000
    assert drawn.tolist() == pytest.approx([0.7, 0.2, 0.1], abs=0.015)


def test_short_episodes_are_begun_more_often_until_the_steps_are_shared_out() -> None:
    """Three skills whose episodes last 20, 100 and 200 steps."""
    sampling, length = focal(3, focal="none", focal_steps=True), T([20.0, 100.0, 200.0])
    assert sampling.commanded.tolist() == pytest.approx([1 / 3] * 3)
    for _ in range(2000):
        steps = sampling.commanded * length
        labels = torch.arange(3).repeat_interleave((4096 * steps / steps.sum()).round().long())
        sampling.update(torch.full((len(labels),), 0.5), labels)
    shares = sampling.commanded * length
    assert (shares / shares.sum()).tolist() == pytest.approx([1 / 3] * 3, abs=0.01)
    assert sampling.probability.tolist() == pytest.approx([1 / 3] * 3)  # clips are drawn as ever

    again = focal(3, focal="none", focal_steps=True)
    again.load_state_dict(sampling.state_dict())
    assert torch.equal(again.commanded, sampling.commanded)


def test_a_skill_of_which_no_step_is_left_is_not_begun_for_ever() -> None:
    sampling = focal(2, focal_steps=True)
    for _ in range(5000):
        sampling.update(T([0.5]), T([0]))
    assert sampling.commanded[1] < 0.999
    assert sampling.commanded.isfinite().all()


def test_without_it_new_episodes_have_the_shares_themselves() -> None:
    sampling = focal(3, focal_rate=1.0)
    sampling.update(T([0.1, 0.5, 0.9, 0.9]), T([0, 1, 2, 2]))
    assert torch.equal(sampling.commanded, sampling.probability)
