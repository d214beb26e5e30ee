"""Samples of a posterior as files: read back to the same bits, and clear ends."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import excite
from excite.export.models.robot_yaml import ranges_text
from excite.study.posterior_samples import PosteriorSamples, load_posterior

SAMPLES = Path(__file__).resolve().parents[2] / "samples" / "posterior-1"
FIELDS = ("robot", "result_sha256", "seed", "prior", "names", "units", "base_names", "base_units", "distance", "notes")


def samples(count: int = 1200) -> PosteriorSamples:
    rng = np.random.default_rng(0)
    values = np.column_stack([rng.normal(5, 1e-9, count), rng.lognormal(0, 3, count) * 1e-7, np.zeros(count)])
    return PosteriorSamples(
        robot='an "arm", with a comma',
        result_sha256="ab" * 32,
        seed=7,
        prior=0.3,
        names=("m1", "I1xx", "m1c1x"),
        units=("kg", "kg m^2", "kg m"),
        values=values,
        base_names=("X1",),
        base_units=("kg",),
        base_matrix=np.array([[1.0, 1 / 3, 0.0]]),
        distance=0.1,
        effective=900.0,
        split_deviation=np.nan,
        notes=("one, note",),
    )


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_samples_read_back_to_the_same_bits(suffix: str, tmp_path: Path) -> None:
    written = samples()
    path = written.save(tmp_path / f"samples{suffix}")
    read = load_posterior(path)
    np.testing.assert_array_equal(read.values, written.values)
    np.testing.assert_array_equal(read.base_matrix, written.base_matrix)
    assert [getattr(read, name) for name in FIELDS] == [getattr(written, name) for name in FIELDS]
    assert np.isnan(read.split_deviation)
    first = path.read_bytes()
    written.save(path, replace=True)
    assert path.read_bytes() == first


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_files_of_schema_1_are_the_same_samples(suffix: str) -> None:
    read, known = load_posterior(SAMPLES / f"samples{suffix}"), samples(12)
    np.testing.assert_array_equal(read.values, known.values)
    np.testing.assert_array_equal(read.base_matrix, known.base_matrix)
    assert [getattr(read, name) for name in FIELDS] == [getattr(known, name) for name in FIELDS]
    assert np.isnan(read.split_deviation)


def test_other_programs_read_the_names_and_the_table(tmp_path: Path) -> None:
    with np.load(samples().save(tmp_path / "samples.npz"), allow_pickle=False) as file:
        assert [tuple(file[name]) for name in FIELDS[4:8]] == [getattr(samples(), name) for name in FIELDS[4:8]]
    text = samples().save(tmp_path / "samples.csv").read_text()
    np.testing.assert_array_equal(np.loadtxt(io.StringIO(text), delimiter=",", skiprows=2), samples().values)


def test_what_is_there_is_not_replaced(tmp_path: Path) -> None:
    path = samples().save(tmp_path / "samples.npz")
    with pytest.raises(excite.InputError, match="is there already; `replace`"):
        samples().save(path)


def _array(change: Callable[[dict[str, np.ndarray]], None]) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        with np.load(samples().save(folder / "samples.npz")) as file:
            arrays = dict(file)
        change(arrays)
        np.savez(folder / "samples.npz", **arrays)
        return folder / "samples.npz"

    return write


def _text(content: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        (folder / "samples.csv").write_text(content)
        return folder / "samples.csv"

    return write


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda folder: folder / "nowhere.npz", "cannot read .*nowhere.npz"),
        (lambda folder: folder / "nowhere.csv", "cannot read .*nowhere.csv"),
        (lambda folder: folder / "samples.txt", "read from .npz or .csv, given .*samples.txt"),
        (_text(""), "holds no samples"),
        (_text("m1,m2\n1,2\n"), "no facts in its first line"),
        (_text("# {}\nm1\n1\n"), "holds no samples"),
        (_array(lambda a: a.pop("values")), "holds no samples"),
        (_array(lambda a: a.update(values=a["values"][:, :2])), "arrays of other sizes"),
        (_array(lambda a: a.update(facts=np.array(json.dumps({"schema": "excite.other/1"})))), "holds no samples"),
    ],
)
def test_other_files_are_refused(write: Callable[[Path], Path], message: str, tmp_path: Path) -> None:
    with pytest.raises(excite.InputError, match=message):
        load_posterior(write(tmp_path))


def test_a_range_leaves_as_many_samples_below_as_above() -> None:
    drawn = samples(10_001)
    drawn = replace(drawn, values=np.arange(10_001.0)[:, None] * [1.0, 2.0, 3.0])
    for one, size in zip(drawn.ranges(0.9), (1.0, 2.0, 3.0), strict=False):
        assert (one.low, one.high) == pytest.approx((500.0 * size, 9500.0 * size))


def test_ranges_read_back_by_another_yaml_reader() -> None:
    text = ranges_text(samples(), 0.99, ("a comment",))
    content = yaml.safe_load(text)
    assert content["level"] == 0.99
    assert content["robot"] == samples().robot
    for one in samples().ranges(0.99):
        stated = content["parameters"][one.name]
        assert stated["unit"] == one.unit
        for name in ("low", "high", "mean", "deviation"):
            assert isinstance(stated[name], float)
            assert stated[name] == getattr(one, name)
