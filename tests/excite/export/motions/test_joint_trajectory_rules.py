"""Each rule by which joint_trajectory_controller refuses a trajectory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from excite.errors import BrokenLimitError
from excite.export.motions.ros2 import broken_rules, check_rules, quoted
from regressors.readers.documents import yaml_float

JOINTS = ("a", "b")


def trajectory() -> dict[str, Any]:
    def point(sec: int, q: float, v: float) -> dict[str, Any]:
        rates = {"velocities": [v, v], "accelerations": [0.0, 0.0], "effort": []}
        return {"positions": [q, q], **rates, "time_from_start": {"sec": sec, "nanosec": 5}}

    points = [point(0, 0.0, 0.0), point(1, 1.0, 0.5), point(2, 2.0, 0.0)]
    return {"header": {"stamp": {"sec": 0, "nanosec": 0}}, "joint_names": ["b", "a"], "points": points}


def change(*place: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def made(message: dict[str, Any]) -> None:
        at: Any = message
        for key in place[:-1]:
            at = at[key]
        at[place[-1]] = to

    return made


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        (change("joint_names", to=["a"]), "joint_names"),
        (change("joint_names", to=["a", "c"]), "joint_names"),
        (change("points", to=[]), "no points"),
        (change("header", "stamp", "sec", to=1), "stamp"),
        (change("points", 2, "velocities", to=[0.0, 1.2e-7]), "last point"),
        (change("points", 1, "time_from_start", to={"sec": 0, "nanosec": 5}), "time_from_start"),
        (change("points", 2, "time_from_start", to={"sec": 1, "nanosec": 4}), "time_from_start"),
        (change("points", 0, "time_from_start", to={"sec": -1, "nanosec": 0}), "time_from_start"),
        (change("points", 1, "time_from_start", to={"sec": 0, "nanosec": 1_000_000_000}), "time_from_start"),
        (change("points", 1, "positions", to=[1.0]), "positions"),
        (change("points", 1, "velocities", to=[]), "velocities"),
        (change("points", 1, "accelerations", to=[0.0]), "accelerations"),
        (change("points", 1, "effort", to=[0.0, 0.0]), "effort"),
    ],
)
def test_each_rule_is_checked(changed: Callable[[dict[str, Any]], None], word: str) -> None:
    message = trajectory()
    assert broken_rules(message, JOINTS) == []
    changed(message)
    assert any(word in rule for rule in broken_rules(message, JOINTS))
    with pytest.raises(BrokenLimitError, match="joint_trajectory_controller refuses the motion"):
        check_rules(message, JOINTS)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_pyyaml_reads_every_number_back(value: float) -> None:
    read = yaml.safe_load(yaml_float(value))
    assert isinstance(read, float)
    assert read == value


@given(st.text(st.characters(codec="utf-8", exclude_categories=("C", "Zl", "Zp")), min_size=1))
def test_pyyaml_reads_every_name_back(name: str) -> None:
    assert yaml.safe_load(f"[{quoted(name)}]") == [name]


@pytest.mark.parametrize("name", ["no", "1e3", "12:30", "a: b", 'q"1', "010", "~", "a#b", "back\\slash"])
def test_names_that_look_like_something_else_stay_names(name: str) -> None:
    assert yaml.safe_load(quoted(name)) == name
