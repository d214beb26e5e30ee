"""No file holds a number that is not finite: what is not is named by its place, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.storage.atomic import check_content, check_table, write_json
from regressors.errors import NumericalError

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("content", "place"),
    [
        ({"a": NAN}, "a is not finite"),
        ({"a": {"b": [1.0, INF]}}, r"a.b\[2\] is not finite"),
        ([[0.0], [-INF]], r"\[2\]\[1\] is not finite"),
        (NAN, "it is not finite"),
    ],
)
def test_json_that_is_not_finite_is_not_written(content: object, place: str, tmp_path: Path) -> None:
    with pytest.raises(NumericalError, match=f"^out.json is not written: {place}"):
        write_json(tmp_path / "out.json", content)
    assert list(tmp_path.iterdir()) == []


def test_a_column_that_is_not_finite_is_named() -> None:
    table = np.zeros((4, 3))
    check_table(Path("motion.csv"), ("time", "a", "b"), table)
    table[2, 1] = NAN
    with pytest.raises(NumericalError, match=r"^motion.csv is not written: a is not finite in row 3"):
        check_table(Path("motion.csv"), ("time", "a", "b"), table)


def test_what_is_finite_passes() -> None:
    check_content(Path("a"), {"a": [1, 1.5, None, "nan", True], "b": {}})


def test_a_log_that_is_not_finite_is_not_written(tmp_path: Path) -> None:
    q = np.zeros((3, 1))
    log = Log("log", "0" * 64, ("j",), np.arange(3.0), q)
    object.__setattr__(log, "q", np.array([[0], [INF], [0]]))  # by other means than its constructor, which refuses it
    with pytest.raises(NumericalError, match=r"j.position is not finite in row 2"):
        write_log(log, tmp_path / "log.csv")
    assert list(tmp_path.iterdir()) == []
