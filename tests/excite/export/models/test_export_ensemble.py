"""Ensembles of possible robots: what independent programs make of every one, and what is left after an interruption."""

from __future__ import annotations

import json
from functools import partial
from hashlib import sha256
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml
from identified import result_of, two_links, with_estimate

import excite
from excite.identification.identification import Identification, torque_target
from excite.study.posterior_samples import load_posterior
from regressors.samples import Samples

COUNT, LEVEL = 6, 0.6  # a lower level takes fewer draws


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Identification:
    return two_links(tmp_path_factory.mktemp("result"))


@pytest.fixture(scope="module")
def ensemble(result: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parent") / "ensemble"
    exported = excite.export_ensemble(result, "mjcf", folder, samples=COUNT, seed=3, level=LEVEL)
    assert exported.files[0] == folder / "ensemble.json"
    assert exported.facts == {"robots": COUNT}
    return folder


def robots(folder: Path) -> list[Path]:
    return [*sorted(folder.glob("*.xml")), *sorted(folder.glob("*.urdf"))]


def test_mujoco_takes_every_robot_as_it_is(ensemble: Path) -> None:
    masses = set()
    assert [path.name for path in robots(ensemble)] == [f"ur10e-{k:04d}.xml" for k in range(1, COUNT + 1)]
    for path in robots(ensemble):
        assert 'balanceinertia="false"' in path.read_text()
        model = mujoco.MjModel.from_xml_path(str(path))
        data, M = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        for seed in range(5):
            data.qpos[:] = np.random.default_rng(seed).uniform(-np.pi, np.pi, model.nq)
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, M)
            assert np.linalg.eigvalsh(M)[0] > 0
        assert np.all(model.body_mass[1:] > 0)
        assert np.all(model.dof_armature >= 0)
        assert np.all(model.dof_frictionloss[1:3] > 0)
        masses.add(float(model.body_mass[3]))
    assert len(masses) == COUNT


def test_pinocchio_finds_positive_mass_matrices_and_possible_bodies(result: Identification, tmp_path: Path) -> None:
    excite.export_ensemble(result, "urdf", tmp_path / "e", samples=COUNT, level=LEVEL)
    assert len(robots(tmp_path / "e")) == COUNT
    for path in robots(tmp_path / "e"):
        model = pin.buildModelFromUrdf(str(path))
        data, rng = model.createData(), np.random.default_rng(0)
        for inertia in model.inertias[1:]:
            pseudo = pin.PseudoInertia.FromInertia(inertia).toMatrix()
            assert np.linalg.eigvalsh(pseudo)[0] > 0
        for _ in range(5):
            M = np.array(pin.crba(model, data, rng.uniform(-np.pi, np.pi, model.nq)))
            M = np.triu(M) + np.triu(M, 1).T
            assert np.linalg.eigvalsh(M)[0] > 0


def test_robots_have_the_torques_of_their_samples(result: Identification, ensemble: Path) -> None:
    """MuJoCo's static torques of the moving joints are those of the sample's base parameters."""
    samples = load_posterior(ensemble / "samples.npz")
    target = torque_target(result)
    q = np.random.default_rng(1).uniform(-1, 1, (4, 6))
    q[:, [0, 3, 4, 5]] = 0.0  # held joints
    definition, names = target.model.definition()
    for k, path in enumerate(robots(ensemble)):
        model = mujoco.MjModel.from_xml_path(str(path))
        model.dof_frictionloss[:] = 0.0
        data = mujoco.MjData(model)
        theta = np.array([samples.standard(k)[name] for name in names])
        still = np.zeros((4, 2))
        Y = target.model.instants(Samples(np.arange(4.0), q[:, 1:3], still, still, still)) @ definition
        for row, expected in zip(q, (Y @ theta).reshape(4, 2), strict=True):
            data.qpos[:] = row
            mujoco.mj_inverse(model, data)
            np.testing.assert_allclose(data.qfrc_inverse[1:3], expected, atol=1e-9 * np.abs(expected).max())


def test_the_list_names_everything(ensemble: Path, result: Identification) -> None:
    content = json.loads((ensemble / "ensemble.json").read_text())
    assert content["schema"] == "excite.ensemble/1"
    assert (content["seed"], content["samples"], content["level"]) == (3, COUNT, LEVEL)
    assert content["result_sha256"] == sha256((result.folder / "result.json").read_bytes()).hexdigest()
    assert set(content["files"]) == {path.name for path in ensemble.iterdir()} - {"ensemble.json"}
    for name, expected in content["files"].items():
        assert sha256((ensemble / name).read_bytes()).hexdigest() == expected
    samples = load_posterior(ensemble / "samples.npz")
    assert content["mean"] == dict(zip(samples.names, samples.mean.tolist(), strict=True))
    ranges = yaml.safe_load((ensemble / "ranges.yaml").read_text())
    assert {one.name for one in samples.ranges(LEVEL)} == set(ranges["parameters"])


def test_the_same_seed_gives_the_same_bytes(result: Identification, ensemble: Path, tmp_path: Path) -> None:
    excite.export_ensemble(result, "mjcf", tmp_path / "again", samples=COUNT, seed=3, level=LEVEL)
    for path in ensemble.iterdir():
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes()


def test_an_older_ensemble_is_replaced_as_a_whole(result: Identification, tmp_path: Path) -> None:
    folder = tmp_path / "e"
    excite.export_ensemble(result, "mjcf", folder, samples=4, level=LEVEL)
    (folder / "mine.txt").write_text("mine")
    with pytest.raises(excite.InputError, match="already holds an ensemble"):
        excite.export_ensemble(result, "mjcf", folder, samples=2, level=LEVEL)
    excite.export_ensemble(result, "urdf", folder, samples=2, level=LEVEL, replace=True)
    assert [path.suffix for path in robots(folder)] == [".urdf"] * 2
    assert (folder / "mine.txt").exists()


def test_what_is_written_stays_after_an_interruption(result: Identification, tmp_path: Path) -> None:
    def interrupt(done: int, total: int, left: int = 2) -> None:
        if done >= total - left:
            raise KeyboardInterrupt

    exported = excite.export_ensemble(result, "mjcf", tmp_path / "e", samples=5, level=LEVEL, progress=interrupt)
    assert exported.facts == {"robots": 3, "interrupted": True}
    content = json.loads((tmp_path / "e" / "ensemble.json").read_text())
    assert content["interrupted"] is True
    assert len(robots(tmp_path / "e")) == 3
    assert set(content["files"]) == {path.name for path in (tmp_path / "e").iterdir()} - {"ensemble.json"}
    at_once = partial(interrupt, left=99)
    with pytest.raises(KeyboardInterrupt):
        excite.export_ensemble(result, "mjcf", tmp_path / "f", samples=5, level=LEVEL, progress=at_once)
    assert not (tmp_path / "f").exists()


def test_bad_options_are_refused(result: Identification, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for options, message in (
        ({"samples": 0}, "samples"),
        ({"level": 0.3}, "level"),
        ({"seed": -3}, "seed"),
        ({"prior": -0.1}, "prior"),
        ({"robot_file": "arm.urdf"}, "takes one that ends in .xml, .mjcf"),
        ({"out": "file"}, "it is a file; name a folder"),
    ):
        with pytest.raises(excite.InputError, match=message):
            excite.export_ensemble(result, "mjcf", tmp_path / options.pop("out", "e"), **options)
    assert not (tmp_path / "e").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["irp6", "panda"])
def test_mujoco_takes_every_robot_of_whole_arms(name: str, tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    result = result_of(excite.load_robot(name), tmp_path)
    beta = result.coefficients
    size = np.maximum(np.abs(beta), 0.003 * np.abs(beta).max())
    result = with_estimate(result, covariance=np.diag((0.1 * size) ** 2), degrees_of_freedom=100)
    excite.export_ensemble(result, "mjcf", tmp_path / "e", samples=40)
    assert len(robots(tmp_path / "e")) == 40
    for path in robots(tmp_path / "e"):
        model = mujoco.MjModel.from_xml_path(str(path))
        assert np.all(model.body_mass[1:] > 0)
        assert np.all(model.dof_frictionloss >= 0)
