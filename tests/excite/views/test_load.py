"""Whatever was saved is loaded by one call, by its folder or its file; recorded samples are of every kind."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import excite
from regressors.errors import InputError

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
KINDS = {
    "accuracy-1/accuracy.json": "AccuracyPrediction",
    "bound-1/bound.json": "DesignBound",
    "campaign-1": "SweepTable",
    "design-1": "Design",
    "design-1/design.json": "Design",
    "friction-fit-1": "FrictionFit",
    "friction-plan-1": "FrictionPlan",
    "posterior-1/samples.csv": "PosteriorSamples",
    "posterior-1/samples.npz": "PosteriorSamples",
    "result-1": "Identification",
    "result-1/result.json": "Identification",
    "study-1": "TimeStudy",
    "verification-1/verification-run.json": "Verification",
}


@pytest.mark.parametrize("place", KINDS)
def test_recorded_samples_of_every_kind(place: str, tmp_path: Path) -> None:
    shutil.copytree(SAMPLES / place.partition("/")[0], tmp_path / place.partition("/")[0])
    assert type(excite.load(tmp_path / place)).__name__ == KINDS[place]


def test_a_payload_of_the_first_schema_is_to_be_identified_again() -> None:
    with pytest.raises(InputError, match="identify the payload again"):
        excite.load(SAMPLES / "payload-1")


def test_every_sample_is_tried() -> None:
    assert {"payload-1", *(place.partition("/")[0] for place in KINDS)} == {each.name for each in SAMPLES.iterdir()}


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("nothing", None, r"nothing holds none of design\.json, result\.json, .*; name one of its files$"),
        ("a.json", '{"schema": "excite.star/1"}', "expected a design, an identification"),
        ("a.json", "{", "a.json"),
        ("a.csv", "a,b\n1,2\n", "holds no samples of a posterior"),
    ],
)
def test_what_is_none_of_them_is_refused(name: str, text: str | None, message: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        excite.load(tmp_path / name)
