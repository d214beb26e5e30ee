"""``excite doctor`` in this environment and in broken ones: missing, too old or damaged packages, wrong numbers."""

from __future__ import annotations

import json
import re
import tomllib
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import pytest
from commands import Here
from packaging.specifiers import SpecifierSet

import excite
from excite.cli import doctor

ROOT = Path(__file__).resolve().parents[3]
METADATA = metadata.metadata("excite-trajectories")


@pytest.fixture
def untested(monkeypatch: pytest.MonkeyPatch) -> None:
    """The self-test left out: what is looked at is the environment."""
    monkeypatch.setattr(doctor, "_self_test", lambda: iter(()))


def findings(here: Here, status: int) -> dict[str, dict[str, Any]]:
    """What the command finds, by its part; what failed has a remedy."""
    ended = here.run("doctor", "--json")
    content = json.loads(ended.stdout)
    assert (ended.returncode, content["healthy"]) == (status, status == 0), content
    assert all(each["remedy"] for each in content["findings"] if each["holds"] is False)
    return {each["part"]: each for each in content["findings"]}


def test_this_environment_is_healthy(here: Here) -> None:
    ended = here.run("doctor")
    verdict, *lines = ended.stdout.splitlines()
    assert ended.returncode == 0, ended.stdout
    assert verdict.startswith("This installation is healthy: ")
    steps = [line.split(":")[0].split()[-1] for line in lines if "self-test" in line]
    assert steps == ["model", "design", "identification", "verification"]
    assert not list(here.cwd.iterdir())


@pytest.mark.usefixtures("untested")
def test_every_package_of_the_metadata_is_looked_at(here: Here) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert doctor._ENABLES.keys() == extras.keys() - {"all", "docs", "test"}
    needed = {re.split(r"[<>=]", each)[0].replace(".", "-") for each in project["dependencies"]}
    found = findings(here, 0)
    assert {part for part, each in found.items() if each["kind"] == "needed"} - {"editables"} == needed
    optional = {part.partition(", for ")[2] for part, each in found.items() if each["kind"] == "optional"}
    assert optional == set(doctor._ENABLES.values())


@pytest.mark.usefixtures("untested")
def test_what_is_missing_too_old_or_damaged_is_named(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = {"clarabel": ModuleNotFoundError("clarabel"), "scipy": ImportError("libgomp.so.1: no\nsuch file")}
    broken["h5py"] = ModuleNotFoundError("h5py")

    def imported(name: str) -> Any:
        if name in broken:
            raise broken[name]
        return import_module(name)

    monkeypatch.setattr(doctor, "import_module", imported)
    version = metadata.version
    monkeypatch.setattr(doctor.metadata, "version", lambda name: "1.26.4" if name == "numpy" else version(name))
    found = findings(here, 1)
    wrong = {part: (each["found"], each["remedy"]) for part, each in found.items() if each["holds"] is False}
    assert wrong == {
        "clarabel": ("missing", "pip install 'clarabel>=0.10'"),
        "numpy": ("1.26.4, where >=2.1 is needed", "pip install 'numpy>=2.1'"),
        "scipy": (
            "cannot be imported (libgomp.so.1: no such file)",
            "pip install 'scipy>=1.14.1' --force-reinstall",
        ),
    }
    reader = found["h5py, for logs in HDF5"]
    assert (reader["holds"], reader["remedy"]) == (None, "pip install 'excite-trajectories[hdf5]'")
    lines = here.run("doctor").stdout.splitlines()
    assert [line[:4] for line in lines[1:] if line[2:4].strip()][:4] == ["  NO"] * 3 + ["  ok"]


def test_a_broken_environment_is_not_tested_further(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "platform", type("", (), {"python_version": lambda: "3.10.4", "platform": lambda: "x"}))
    found = findings(here, 1)
    assert not [each for each in found.values() if each["kind"] == "self-test"]
    assert found["Python"]["remedy"] == f"install Python {METADATA['Requires-Python']}"


def off(*_: Any, **__: Any) -> Any:
    raise RuntimeError("the library computes nonsense")


@pytest.mark.parametrize(
    ("name", "value", "step"),
    [
        ("_LARGEST", 2.6854, "model"),
        ("_CONDITION", 40.0, "design"),
        pytest.param("_DEVIATIONS", 0.1, "identification", marks=pytest.mark.slow),
    ],
)
def test_other_numbers_than_the_known_ones_fail(
    here: Here, monkeypatch: pytest.MonkeyPatch, name: str, value: float, step: str
) -> None:
    monkeypatch.setattr(doctor, "_packages", lambda: iter(()))
    monkeypatch.setattr(doctor, name, value)
    tested = [each for each in findings(here, 1).values() if each["kind"] == "self-test"]
    assert [each["part"] for each in tested if not each["holds"]] == [step]
    assert tested[-1]["part"] == step


def test_what_a_library_raises_is_a_finding(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_packages", lambda: iter(()))
    monkeypatch.setattr(excite, "base_parameters", off, raising=False)
    failed = findings(here, 1)["model"]
    assert failed["found"] == "RuntimeError: the library computes nonsense"
    assert "requirements.lock" in failed["remedy"]


@pytest.mark.usefixtures("untested")
def test_a_source_that_is_not_installed_is_told(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "DISTRIBUTION", "excite-that-nobody-installed")
    assert findings(here, 1)["excite"]["remedy"] == "run 'sh docs/set-up.sh' in its folder"


@pytest.mark.parametrize("allowed", [">=2.1", ">=0.11.9,<0.12", "~=0.3", "==3", "<=3.0", ""])
@pytest.mark.parametrize("version", ["2.1", "2.1.0", "2.0.9", "0.11.9", "0.12.0", "0.11.10", "0.3.1", "3.0", "3.0.1"])
def test_versions_are_compared_as_pip_does(version: str, allowed: str) -> None:
    if allowed == "~=0.3" and version >= "1":
        pytest.skip("an upper end that nothing here states otherwise")
    assert doctor._fits(version, allowed) == SpecifierSet(allowed).contains(version)
