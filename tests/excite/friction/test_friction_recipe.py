"""The README's recipe: one drive's friction on its own, then a design and an identification with its curve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import run

from excite.identification.result_json import load_result, result_content
from excite.tasks.friction_file import read_friction
from regressors.robot.friction.curve import CoulombViscous

pytestmark = pytest.mark.slow
STEPS = (
    "friction plan irp6 --drives 2 --warm-up 2 --breakaways 1 --out plans/irp6",  # shorter than the README's, for time
    "simulate plans/irp6/z2.csv --controller pd --bandwidth 10 --torque-noise 0.5 --rate 1000 --out run.csv",
    "friction fit irp6 run.csv --plan plans/irp6 --out friction/irp6",
    "design irp6 --friction-curves friction/irp6/friction.yaml --starts 2 --out designs/masses",
    "simulate designs/masses --encoder 4000 --torque-noise 1 --seed 1 --out masses.csv",
    "identify irp6 masses.csv --design designs/masses --out results/masses",
    "identify irp6 masses.csv --friction-curves friction/irp6/friction.yaml --out results/named",
)


@pytest.mark.parametrize("folder", ["masses", "named"])
def test_masses_are_within_their_intervals(folder: str, results: Path) -> None:
    content = result_content(load_result(results / folder))
    assert [p["name"] for p in content["parameters"]] == [*(f"X{k}" for k in range(1, 8)), "F1c", "F3c", "F1v", "F3v"]
    assert content["reference"] == "truth"
    assert content["relative_error"] < 0.05
    for p in content["parameters"]:
        if p["name"].startswith("X"):
            assert p["interval"][0] <= p["reference"] <= p["interval"][1], p["name"]
        else:  # the width over which friction changes its sign is taken as exact
            assert p["value"] == pytest.approx(p["reference"], rel=0.01), p["name"]


def test_the_curve_is_that_of_the_drive(results: Path) -> None:
    curve = read_friction(results.parent / "friction" / "irp6" / "friction.yaml").curve("z2")
    speed = np.array([-1.0, -0.3, -0.06, 0.06, 0.3, 1.0])
    np.testing.assert_allclose(curve.torque(speed), CoulombViscous(28.75, 26.0).torque(speed), rtol=1e-3)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recipe")
    for step in STEPS:
        ended = run(*step.split(), cwd=folder)
        assert ended.returncode == 0, ended.stderr
    return folder / "results"
