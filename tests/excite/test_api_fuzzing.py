"""Calls of everything public with wrong and odd arguments end in a result or an `ExciteError`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path

import api_fuzzer
import numpy as np
import pytest
from api_fuzzer import Api, called, cases, problem, problem_of_child, public_api

import excite

KINDS = ("values", "files", "designs", "measurements", "outputs")
TESTS = Path(__file__).parents[1]
CALLS = 250  # of each kind, and of each class
RESULTS = {
    "AccuracyPrediction", "CalibratedGains", "SweepTable", "Design", "DesignBound", "EarlierInformation", "Estimate",
    "Identification", "NextMotion", "PayloadMotion", "PayloadResult", "PosteriorSamples",
    "PrecisionInHand", "Simulation", "TimeCourse", "TimeStudy", "Verification",
}  # fmt: skip
PARTS = {
    "BSpline", "Collisions", "Cosine", "DifferentialModel", "EnergyModel", "Fourier", "FourierQuintic",
    "LoadIntegralModel", "LoadModel", "PayloadModel", "PlausibleTorqueLimit",
    "Sines", "ToolBox", "ToolSpeed", "TorqueLimit", "Waypoints",
}  # fmt: skip
INTERFACES = {
    "Criterion", "Estimator", "Family", "Limit", "LinearFamily", "ModelFormat", "MotionFormat", "RegressorModel",
    "Solver", "SpectralCriterion", "TorqueNoise",
}  # fmt: skip


@pytest.fixture(scope="module")
def api() -> Iterator[Api]:
    with public_api() as made:
        yield made


@pytest.mark.slow
def test_every_public_callable_is_fuzzed(api: Api) -> None:
    fuzzed = {name for kind in KINDS for name in getattr(api, kind)()}
    errors = {name for name in excite.__all__ if name.endswith("Error")}
    assert fuzzed | errors | RESULTS | INTERFACES | {"built_in_names"} == set(excite.__all__) | PARTS
    assert all(is_dataclass(getattr(excite, name)) for name in RESULTS)


@pytest.mark.slow
def test_objects_of_each_class(api: Api) -> None:
    calls = api.values()
    made = cases(api, calls, CALLS * len(calls), 0)
    assert [(name, found, repr(given)[:500]) for name, given in made if (found := problem(name, given))] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "values"])
def test_calls_of_each_kind(kind: str) -> None:
    """In a process of its own: a child of one in which other tests have started threads may never end."""
    command = [sys.executable, "-W", "error", api_fuzzer.__file__, kind, str(CALLS), "0"]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, cwd=TESTS)
    assert json.loads(ended.stdout) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["values", "measurements"])
def test_the_right_calls_work(kind: str, api: Api) -> None:
    skipped = {"identify_payload", "calibrate_gains", "fit_friction"}  # need logs of other experiments
    for name, arguments in getattr(api, kind)().items():
        if name not in skipped:
            called(getattr(excite, name), arguments)


def test_the_fuzzer_sees_what_must_not_be(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(seed: int) -> None:
        raise KeyError(seed)

    monkeypatch.setattr(excite, "compare", fails)
    for judge in (problem, problem_of_child):
        assert str(judge("compare", {"seed": 1})).startswith("KeyError: 1")
    monkeypatch.setattr(excite, "compare", lambda seed: os._exit(3))
    assert problem_of_child("compare", {"seed": 1}) == "the process ended with 3"
    assert problem("Tolerances", {"torque": np.array([1j])}) is None
