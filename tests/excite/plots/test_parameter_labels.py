"""Labels of base parameters: whole sums over several lines, and rows as high as they need."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from excite.information.target import target_of
from excite.plots.parameter_labels import LINES, parameter_label, row_places, wrapped_sum
from excite.plots.style import typeset
from excite.tasks.task import Task
from regressors.readers.library import load_robot

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
