"""What a result keeps of its logs and equations: curves that do not fit each other or the logs are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from excite.identification.result import BaseColumns, FitCurves, FitFacts, IdentifiedLog
from regressors.errors import InputError

ROWS: dict[str, Any] = {
    "time": np.arange(4.0),
    "log": np.zeros(4, dtype=np.int16),
    "equation": np.array([0, 1, 0, 1], dtype=np.int16),
    "measured": np.ones(4),
    "predicted": np.ones(4),
    "joints": ("a", "b"),
    "motion_time": np.arange(3.0),
    "motion_log": np.zeros(3, dtype=np.int16),
    "motion_q": np.zeros((3, 2)),
}


def facts(**changes: Any) -> FitFacts:
    log, base = IdentifiedLog("run.csv", "hash", 4, 0.0, 3.0, 4, 1.0), BaseColumns(0, (), np.inf, ())
    equations = (("q1", "Nm"), ("q2", "Nm"))
    curves = FitCurves(**{**ROWS, **changes})
    return FitFacts((log,), equations, 4, base, {}, 0.1, 0.1, (), None, curves=curves)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"measured": np.ones((4, 1))}, "a measured and a predicted value of every row"),
        ({"measured": np.ones(3)}, "a measured and a predicted value of every row"),
        ({"log": np.full(4, 7, dtype=np.int16)}, r"1 log\(s\) and 2 equation"),
        ({"equation": np.full(4, -1, dtype=np.int16)}, r"1 log\(s\) and 2 equation"),
        ({"equation": np.zeros(4)}, r"1 log\(s\) and 2 equation"),
        ({"motion_log": np.full(3, 1, dtype=np.int16)}, r"1 log\(s\) and 2 equation"),
        ({"motion_log": np.zeros(2, dtype=np.int16)}, "a log of every instant of the motion"),
        ({"motion_q": np.zeros((3, 5))}, "positions of every joint"),
    ],
)
def test_curves_that_do_not_fit_are_refused(change: dict[str, Any], message: str) -> None:
    assert facts().curves.step == 1
    with pytest.raises(InputError, match=message):
        facts(**change)


def test_a_file_keeps_every_kth_instant_of_long_logs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("excite.identification.result.every", lambda _: 2)
    curves = FitCurves(**{**ROWS, "time": np.array([0.0, 0.0, 1.0, 1.0]), "measured": np.arange(4.0) / 3})
    kept = replace(curves, step=3).stored()
    assert (kept.step, kept.time.tolist(), kept.equation.tolist()) == (6, [0.0, 0.0], [0, 1])
    np.testing.assert_allclose(kept.measured, [0.0, 1 / 3], rtol=1e-6)
    assert kept.measured.dtype == np.float32
