"""What tells whether starts on disk are of the same problem."""

from __future__ import annotations

import dataclasses
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from excite.design.formulation import formulate
from excite.design.problem_identity import NotComparable, ProblemIdentity, plain_value
from excite.tasks.criteria import ConditionNumber
from excite.tasks.task import Task
from regressors.readers.library import load_robot

TASK = Task("irp6", harmonics=3, starts=2)


def identity(task: Task) -> ProblemIdentity:
    return formulate(load_robot("irp6"), task).identity


@pytest.fixture(scope="module")
def first() -> ProblemIdentity:
    return identity(TASK)


@pytest.mark.parametrize("options", [{"starts": 9}, {"workers": 3}, {"executor": "serial"}, {"speed": (0.5,)}])
def test_what_no_start_depends_on_leaves_the_identity(options: dict[str, Any], first: ProblemIdentity) -> None:
    assert identity(TASK.changed(**options)).sha256 == first.sha256


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"seed": 1}, "search.seed 0 -> 1"),
        ({"rate": 50.0}, "output.rate 100.0 -> 50.0"),
        ({"harmonics": 4}, "trajectory.harmonics 3 -> 4"),
        ({"velocity": (0.5,)}, "limits.velocity null -> [0.5]"),
        ({"criterion": ConditionNumber()}, ""),
    ],
)
def test_what_a_start_depends_on_changes_it_and_is_named(
    options: dict[str, Any], told: str, first: ProblemIdentity
) -> None:
    other = identity(TASK.changed(**options))
    assert other.sha256 != first.sha256
    assert told in other.differences(first.content)


def test_untrusted_content_is_not_echoed(first: ProblemIdentity) -> None:
    content = {**first.content, "search": {"seed": "\x1b[31m" * 9, "y" * 900: 1}, "own": 3}
    told = first.differences(content)
    assert told.isprintable()
    assert len(told) < 300


def test_a_part_without_source_is_a_doubt() -> None:
    hidden: dict[str, Any] = {"__name__": "nowhere"}
    exec("from excite import ConditionNumber\nclass Mine(ConditionNumber): pass", hidden)
    found = identity(TASK.changed(criterion=hidden["Mine"]()))
    assert found.sha256 is None
    assert found.doubt == "the source of Mine is not accessible"


@dataclasses.dataclass
class Part:
    size: float
    table: Any = None


class Plain:
    def __init__(self, size: float) -> None:
        self.size = size

    @cached_property
    def double(self) -> float:
        return 2 * self.size


class Cyclic:
    def __init__(self) -> None:
        self.me = self


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (1, 2),
        (1.0, 1.0 + 2**-52),
        (float("nan"), float("inf")),
        ("1", 1),
        ({"a": 1}, {"a": 2}),
        ((1, 2), (2, 1)),
        (Part(1.0), Part(2.0)),
        (Plain(1.0), Plain(2.0)),
        (Part(1.0), Plain(1.0)),
        (np.arange(3), np.arange(4)),
        (np.arange(100), np.arange(100) + 1),
        (np.arange(100), np.arange(100.0)),
        (Path("a"), Path("b")),
        (Part, Plain),
        (b"a", b"b"),
    ],
)
def test_other_values_are_others(a: Any, b: Any) -> None:
    assert plain_value(a) == plain_value(a)
    assert plain_value(a) != plain_value(b)


def test_what_is_computed_from_the_rest_does_not_count() -> None:
    one, other = Plain(1.0), Plain(1.0)
    assert one.double == 2.0
    assert plain_value(one) == plain_value(other)
    assert plain_value({"b", "a", "c"}) == plain_value({"c", "b", "a"})


@pytest.mark.parametrize("value", [Cyclic(), (each for each in ())])
def test_what_cannot_be_compared_is_said(value: Any) -> None:
    with pytest.raises(NotComparable):
        plain_value(value)
