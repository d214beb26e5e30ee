"""Labels of base parameters: whole sums over several lines, rows as high as they need, a colour for each unit."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.information.target import target_of
from excite.tasks.task import Task
from excite.views.bars import LINES, parameter_label, row_places, unit_patches, unit_style, wrapped_sum
from excite.views.style import typeset
from regressors.readers.library import load_robot
from regressors.robot.columns import _DRIVE_COLUMNS
from regressors.robot.inertia import PARAMETER_UNITS

TERM = st.sampled_from(["m1", "0.106662 m4c4z", "2 d5 m5c5z", "l2^2 m3", "$a$", "a_very_long_name_of_one_term"])


@given(TERM, st.lists(st.tuples(st.sampled_from("+-"), TERM), max_size=15), st.integers(10, 80))
def test_lines_hold_every_term_once_and_in_order(first: str, others: list[tuple[str, str]], length: int) -> None:
    text = first + "".join(f" {sign} {term}" for sign, term in others)
    lines = wrapped_sum(text, length)
    assert " ".join(lines) == text
    longest = max(len(term) + 3 for term in (first, *(term for _, term in others)))
    assert all(len(line) <= max(length, longest) for line in lines)


@pytest.mark.parametrize("robot", ["irp6", "panda", "iiwa7", "ur10e"])
def test_expressions_of_built_in_arms_are_whole(robot: str) -> None:
    base = target_of(load_robot(robot), Task(robot)).base
    for name, expression in zip(base.names, base.expressions, strict=True):
        text = parameter_label(name, expression, 42, "design.json").replace("\n", " ")
        assert text in (typeset(expression), typeset(f"{name} = {expression}"))


def test_an_expression_of_too_many_lines_is_left_to_the_file() -> None:
    expression = "I2xx" + " + 0.123456 m3c3z" * 30
    assert parameter_label("I2xx", expression, 42, "design.json") == "I2xx = sum of 31 terms, in design.json"
    assert parameter_label("a", "a" + " + b" * 30, 40, "design.json").count("\n") < LINES


def test_rows_do_not_overlap() -> None:
    labels = ["a", "b\nc", "d", "e\nf\ng", "h"]
    places, height = row_places(labels)
    lines = np.array([1 + label.count("\n") for label in labels])
    assert height == pytest.approx(float(np.sum(1 + 0.67 * (lines - 1))))
    for (a, m), (b, n) in itertools.pairwise(zip(places, lines, strict=True)):
        assert b - a >= 0.5 * 0.67 * (m + n)


BUILT_IN = {*PARAMETER_UNITS, *(unit for _, *units in _DRIVE_COLUMNS.values() for unit in units), "Nm/rad", "N/m"}


def look(unit: str) -> tuple[object, object]:
    style = unit_style(unit)
    return style["facecolor"], style["hatch"]


def test_every_unit_of_a_built_in_model_has_a_look_of_its_own() -> None:
    assert all(look(a) != look(b) for a, b in itertools.combinations(sorted(BUILT_IN), 2))
    assert look("furlong") not in {look(unit) for unit in BUILT_IN}


def test_a_unit_looks_the_same_on_every_robot() -> None:
    legends = []
    for name in ("irp6", "panda", "ur10e"):
        units = target_of(load_robot(name), Task(name)).base.units
        legends.append({p.get_label(): (p.get_facecolor(), p.get_hatch()) for p in unit_patches(units)})
    for first, second in itertools.combinations(legends, 2):
        assert set(first) & set(second)
        assert all(first[unit] == second[unit] for unit in set(first) & set(second))


def test_units_of_own_models_share_one_entry() -> None:
    assert [patch.get_label() for patch in unit_patches(["W", "kg m", "cd", "kg m"])] == ["kg m", "W, cd"]
