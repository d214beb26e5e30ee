"""``excite.draw`` and ``excite.load``: figures of new and stored results, and everything that was saved."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from reported import ParsedPage, misplaced
from written_files import saved
from written_results import design, plan, result, verification

import excite
from excite.identification.result_json import CURVES
from excite.views.page_text import PageSection
from excite.views.player_log import Appearance
from excite.views.sections import section_of
from excite.views.verification_view import simulation_view
from excite.views.write_report import report_text
from regressors.errors import InputError

# ``excite.draw``: the figures of an object as matplotlib objects, and no file.


def test_a_design_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    figures = excite.draw(design("old"))
    assert list(figures) == ["motion", "phase", "spectrum", "convergence", "workspace"]
    assert all(isinstance(figure, Figure) for figure in figures.values())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_everything_that_has_figures_is_drawn(tmp_path: Path) -> None:
    objects = {
        "result": ({"torques", "residuals", "parameters"}, result("old")),
        "verification": ({"torques", "motion"}, verification("old")),
        "study": ({"estimates_over_time"}, excite.study_over_time("irp6", [], designs=[design("old")])),
        "plan": ({"runs"}, plan("old")),
    }
    for name, (expected, made) in objects.items():
        assert set(excite.draw(made)) == expected, name
        (tmp_path / name).mkdir()
        files = excite.write_figures(made, tmp_path / name, formats="svg", width="double")
        assert len(files) == len(expected)
        assert {path.name.removesuffix(".svg").rpartition("simulated_")[2] for path in files} == expected, name


@pytest.mark.slow
@pytest.mark.parametrize("width", ["single", "double"])
def test_in_a_column_no_text_of_a_design_is_lost(width: str) -> None:
    assert [text for figure in excite.draw(design("old"), width=width).values() for text in misplaced(figure)] == []


# Whatever was saved is loaded by one call, by its folder or its file; recorded samples are of every kind.


SAMPLES = Path(__file__).resolve().parents[2] / "samples"
KINDS = {
    "accuracy-1/accuracy.json": "AccuracyPrediction",
    "bound-1/bound.json": "DesignBound",
    "campaign-1": "SweepTable",
    "design-1": "Design",
    "design-1/design.json": "Design",
    "friction-fit-1": "FrictionFit",
    "friction-plan-1": "FrictionPlan",
    "log-1/run.json": "SimulatedLog",
    "precision-1/precision.json": "PrecisionSearch",
    "posterior-1/samples.csv": "PosteriorSamples",
    "posterior-1/samples.npz": "PosteriorSamples",
    "result-1": "Identification",
    "result-1/result.json": "Identification",
    "study-1": "TimeStudy",
    "verification-1/verification-run.json": "Verification",
}


def test_recorded_samples_of_every_kind(tmp_path: Path) -> None:
    shutil.copytree(SAMPLES, tmp_path / "samples")
    assert {place: type(excite.load(tmp_path / "samples" / place)).__name__ for place in KINDS} == KINDS
    assert {"payload-1", *(place.partition("/")[0] for place in KINDS)} == {each.name for each in SAMPLES.iterdir()}
    with pytest.raises(InputError, match="identify the payload again"):
        excite.load(SAMPLES / "payload-1")


def test_a_simulated_log_is_read_back(tmp_path: Path) -> None:
    simulation = excite.simulate(excite.load(SAMPLES / "design-1"), rate=20.0, torque_noise=0.5)
    simulation.save(tmp_path / "run.csv")
    loaded = excite.load(tmp_path / "run.csv")
    assert replace(loaded, log=None) == simulation.record
    assert simulation_view(loaded) == simulation_view(simulation)


def test_what_is_none_of_them_is_refused(tmp_path: Path) -> None:
    nothing = r"nothing holds none of design\.json, result\.json, .*; name one of its files$"
    with pytest.raises(InputError, match=nothing):
        excite.load(tmp_path / "nothing")
    for name, text, message in (
        ("a.json", '{"schema": "excite.star/1"}', "expected a design, an identification"),
        ("a.json", "{", "a.json"),
        ("b.csv", "a,b\n1,2\n", "holds no samples of a posterior"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=message):
            excite.load(tmp_path / name)


# Figures of results in folders: drawn from their curves, as those of new results; none where there are no curves.


LOOKS = Appearance()
TEXT = re.compile(r"<text[^>]*>([^<]*)")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = saved(tmp_path_factory.mktemp("results") / "result", result("old"))
    return saved(out, verification("old"), name="verification-run")


def texts(section: PageSection) -> list[list[str]]:
    """What is written in each figure: names, units, errors, numbers of the axes."""
    return [TEXT.findall(figure.svg) for figure in section.figures]


@pytest.mark.slow
def test_figures_of_stored_results_are_those_of_new_ones(folder: Path) -> None:
    stored, new = (section_of(each, "s", LOOKS) for each in (excite.load_result(folder), result("old")))
    assert stored.motion == new.motion
    verified = excite.load(folder / "verification-run.json")
    again, first = (section_of(each, "s", LOOKS) for each in (verified, verification("old")))
    assert again.motion is not None
    for one, other, drawn in ((stored, new, 3), (again, first, 2)):
        assert texts(one) == texts(other)
        assert len(texts(other)) == drawn


@pytest.mark.slow
def test_estimates_over_time_are_drawn_from_the_file(tmp_path: Path) -> None:
    log = excite.simulate(design("old"), rate=50.0, seed=0)
    made = excite.identify("irp6", log, choose=False, estimator="recursive")
    section = section_of(excite.load_result(saved(tmp_path / "r", made)), "s", LOOKS)
    assert "Estimates over time" in [figure.title for figure in section.figures]


@pytest.mark.slow
def test_player_shows_the_measured_motion_and_torques() -> None:
    made = result("old")
    motion = section_of(made, "s", LOOKS).motion
    (part,) = made.prepared
    for time in (motion["time"][3], motion["time"][-1]):
        k, frame = int(np.argmin(np.abs(part.samples.time - part.samples.time[0] - time))), motion["time"].index(time)
        np.testing.assert_allclose(np.array(motion["q"])[frame, :3], part.samples.q[k], atol=1e-6)
        column = [(each["owner"], each["quantity"]) for each in motion["limits"]].index(("joint q2", "measured"))
        np.testing.assert_allclose(motion["values"][frame][column], part.measured[k, 1], rtol=1e-3)


def test_a_folder_without_curves_says_so(folder: Path, tmp_path: Path) -> None:
    for path in folder.iterdir():
        if path.suffix == ".json":
            (tmp_path / path.name).write_bytes(path.read_bytes())
    assert CURVES in (tmp_path / "manifest.json").read_text()
    parsed = ParsedPage(report_text(tmp_path))
    said = "".join(parsed.of("main")[0].text)
    assert f"holds no {CURVES}" in said
    assert "the file of curves" in said
    assert len(parsed.of("svg")) == 1  # the parameters
    assert not any("data-motion" in each.attributes for each in parsed.elements)
