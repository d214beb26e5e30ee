"""Which settings are left to be chosen."""

from __future__ import annotations

import pytest
from played import irp6

from excite.identification.choices.choose import free_settings
from excite.identification.choices.friction_terms import TERM_SETTINGS
from excite.identification.recipe import Recipe
from excite.registry import CHOSEN
from excite.tasks.model_choice import ModelChoice
from regressors.errors import UnknownName
from regressors.models.differential import DifferentialModel

EVERY = frozenset(CHOSEN)
RECIPES = [
    ({}, ()),
    ({"cutoff": 10.0}, ("cutoff",)),
    ({"signals": "fourier"}, ("cutoff", "signals")),
    ({"measured_velocity": True}, ("cutoff", "signals")),
    ({"average": True}, ("cutoff", "signals", "delay")),
    ({"period": 2.0}, ("signals",)),
    ({"harmonics": 3}, ("signals",)),
    ({"friction_scale": True}, ("friction_scale",)),
    ({"delay": 0.004}, ("delay",)),
    ({"estimator": "huber"}, ("estimator",)),
    ({"estimator": "physical", "pull": 1.0}, ("estimator",)),
    ({"estimator": "physical", "described_within": 1.0}, ("estimator",)),
    ({"rows": "all", "low_pass": 5.0, "every": 2, "sign_width": 0.1, "covariance": "white"}, ()),
]
MODELS = [
    ({}, ()),
    *(({name: True}, (name,)) for name in sorted(TERM_SETTINGS)),
    ({"offset": ("2",)}, ("offset",)),
    ({"joints": ("1", "2"), "reflected_rotors": False, "stribeck_speed": 0.2}, ()),
]


def free(choose=True, recipe=None, model=None, given=()) -> frozenset[str]:
    return free_settings(choose, Recipe(**(recipe or {})), ModelChoice(**(model or {})), given)


@pytest.mark.parametrize(("recipe", "kept"), RECIPES)
def test_what_the_recipe_gives_is_kept(recipe: dict, kept: tuple[str, ...]) -> None:
    assert free(recipe=recipe) == EVERY - set(kept)


@pytest.mark.parametrize(("model", "kept"), MODELS)
def test_what_the_model_gives_is_kept(model: dict, kept: tuple[str, ...]) -> None:
    assert free(model=model) == EVERY - set(kept)


@pytest.mark.parametrize("name", sorted(EVERY - {"signals"}))
def test_what_was_given_by_name_is_kept_whatever_its_value(name: str) -> None:
    assert free(given=(name,)) == EVERY - {name}


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("signals", {"signals", "cutoff"}),
        ("measured_velocity", {"signals", "cutoff"}),
        ("average", {"signals", "cutoff", "delay"}),
        ("period", {"signals"}),
        ("harmonics", {"signals"}),
        ("friction_scale", {"friction_scale"}),
        ("pull", {"estimator"}),
        ("described_within", {"estimator"}),
    ],
)
def test_settings_that_decide_on_others_keep_these_when_given(given: str, kept: set[str]) -> None:
    assert free(given=(given,)) == EVERY - kept


@pytest.mark.parametrize(
    ("choose", "names"),
    [(True, EVERY), (False, set()), ((), set()), (("cutoff", "delay"), {"cutoff", "delay"}), (["offset"], {"offset"})],
)
def test_only_what_is_asked_for_is_chosen(choose, names: set[str]) -> None:
    assert free(choose) == names


def test_what_is_asked_for_and_given_is_kept() -> None:
    assert free(("cutoff", "delay"), recipe={"cutoff": 3.0}) == {"delay"}


@pytest.mark.parametrize("name", ["cut-off", "average", "rotor", ""])
def test_unknown_names_are_refused(name: str) -> None:
    with pytest.raises(UnknownName, match=r"setting to choose.*cutoff, signals, delay"):
        free(("cutoff", name))


def test_model_objects_keep_their_terms() -> None:
    model = DifferentialModel(irp6())
    assert free_settings(True, Recipe(), ModelChoice(model=model), ()) == EVERY - TERM_SETTINGS
