"""The border of the API: what annotations let in, what they refuse, and what is named."""

import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pytest

import excite
from regressors.arguments import checked, fit, rule_of
from regressors.errors import InputError
from regressors.samples import Array, Samples


class Named(Protocol):
    name: str

    def run(self) -> None: ...


class Runner:
    name = "r"

    def run(self) -> None:
        raise AssertionError("is not called")


VECTOR = np.array([1.0, 2.0])
LET_IN: list[tuple[Any, Any, Any]] = [
    (float, 1, 1),
    (float, np.float32(0.5), 0.5),
    (int, np.int64(3), 3),
    (bool, np.bool_(True), True),
    (str | Path, Path("x"), Path("x")),
    (float | None, None, None),
    (Literal["short", "long"], "long", "long"),
    (tuple[float, ...], 2.0, (2.0,)),
    (tuple[float, ...], [1, 2.5], (1, 2.5)),
    (tuple[float, ...], VECTOR, (1.0, 2.0)),
    (tuple[float, float] | None, [1, 2], (1, 2)),
    (Sequence[float], VECTOR, (1.0, 2.0)),
    (Iterable[str], {"x"}, {"x"}),
    (Mapping[str, float], {"x": 1}, {"x": 1}),
    (Callable[[str], None], print, print),
    (Array, [[1, 2]], np.array([[1.0, 2.0]])),
    (Any, 1j, 1j),
]
REFUSED: list[tuple[Any, Any, str]] = [
    (float, True, "a number"),
    (float, 1j, "a number"),
    (float, np.array(2.0), "a number"),
    (float, 10**400, "a number"),
    (int, 1.0, "a whole number"),
    (bool, 1, "True or False"),
    (str, b"x", "text"),
    (str | Path, "a\0b", "text or a path that a file can have"),
    (str | Path, "x" * 300, "text or a path that a file can have"),
    (str | None, 1, "text or None"),
    (Literal["short", "long"], 1, "'short' or 'long'"),
    (tuple[float, ...], "12", "a number, or a list of numbers"),
    (tuple[float, float], [1.0], r"\(a number, a number\)"),
    (tuple[float, ...], np.array([1j]), "a number, or a list of numbers"),
    (Sequence[str], "torque", "a list of names"),
    (Sequence[float], {1.0}, "a list of numbers"),
    (Mapping[str, float], {1: 1.0}, "a mapping, each a number"),
    (Callable[[str], None], "print", "a function"),
    (Array, np.array([1j]), "an array of real numbers"),
    (Array, [[1.0], [1.0, 2.0]], "an array of real numbers"),
    (Array, 1.0, "an array of real numbers"),
    (Samples, VECTOR, "a Samples"),
    (Named, VECTOR, "a Named"),
]


@pytest.mark.parametrize(("hint", "value", "taken"), LET_IN, ids=str)
def test_what_an_annotation_lets_in(hint: Any, value: Any, taken: Any) -> None:
    got = rule_of(hint)[0](value)
    assert np.array_equal(got, taken)
    assert type(got) is type(taken)


@pytest.mark.parametrize(("hint", "value", "expected"), REFUSED, ids=str)
def test_what_an_annotation_refuses(hint: Any, value: Any, expected: str) -> None:
    with pytest.raises(InputError, match=f"^what: expected {expected}, given "):
        fit("what", value, rule_of(hint))


def test_a_protocol_is_what_has_its_members() -> None:
    runner = Runner()
    assert rule_of(Named)[0](runner) is runner


def test_functions_and_classes_name_the_argument() -> None:
    @checked
    def scaled(x: float, /, *, by: tuple[float, ...] = (1.0,), **more: Any) -> tuple[float, ...]:
        return tuple(x * factor for factor in by)

    @checked
    @dataclass(frozen=True)
    class Point:
        x: float
        label: str = ""

    assert scaled(2.0, by=[3, 4], other=1j) == (6.0, 8.0)  # type: ignore[arg-type]
    assert Point(1) == Point(1.0)
    with pytest.raises(InputError, match=r"^by: expected"):
        scaled(2.0, by=["3"])  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^x: expected a number, given '2'"):
        scaled("2")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^label: expected text, given 1"):
        Point(1.0, 1)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'x'"):
        Point()  # type: ignore[call-arg]


def test_annotations_of_public_names_can_be_evaluated() -> None:
    for thing in (getattr(excite, name) for name in excite.__all__):
        assert isinstance(typing.get_type_hints(thing), dict)
        if isinstance(thing, type):
            assert isinstance(typing.get_type_hints(thing.__init__), dict)
