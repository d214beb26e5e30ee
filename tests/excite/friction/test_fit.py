"""Friction curves from logs: windows of constant speed, points, fits against known truth, and the command."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest
from commands import Here
from friction_runs import ALONG_Q2, TRUTH, pieces, run, there_and_back, unknown
from played import irp6, torques
from refused import refusal

from excite.friction.constant_speed_windows import ConstantWindow, FitSettings, WindowSearch, constant_windows
from excite.friction.curve_fit import fit, table_of
from excite.friction.friction_equations import Conditions, Form
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.points import (
    Point,
    _parabola,
    described_model,
    drive_log,
    mean_deviation,
    paired_points,
    points_of,
)
from excite.logs.log import Log
from excite.logs.log_reading import write_log
from excite.tasks.friction_file import read_friction, write_friction
from regressors.errors import InputError, UnknownName
from regressors.robot.friction.curve import CoulombViscous, Stribeck
from regressors.samples import Samples


def fitted(log: Log, drive: str = "z2", **settings: object) -> Characteristic:
    (one,) = characteristics(irp6(), [log], FitSettings(**settings), described_model, (drive,))
    return one


def test_windows_lie_where_the_speed_is_constant() -> None:
    t, s, v, _ = pieces([(2.0, 0.0), *there_and_back((0.1, 0.4, 0.8))])
    found = constant_windows(t, s, np.zeros((t.size, 0)), WindowSearch(0.3, 0.02, 0.01))
    assert len(found.windows) > 10
    for window in found.windows:
        speeds, last = v[window.start : window.stop], window.stop - 1
        assert np.ptp(speeds) <= 0.06 * abs(window.speed)
        assert window.speed == pytest.approx(speeds.mean(), rel=1e-2)
        assert window.speed == pytest.approx((s[last] - s[window.start]) / (t[last] - t[window.start]))
    assert all(after.start >= before.stop - 1 for before, after in itertools.pairwise(found.windows))
    assert {round(abs(w.speed), 2) for w in found.windows} == {0.1, 0.4, 0.8}
    assert found.resting >= 5
    spans = ((2.51, 2.81), (3.0, 3.7))
    inside = constant_windows(t + 7.0, s, np.zeros((t.size, 0)), WindowSearch(0.3, 0.02, 0.01, spans)).windows
    assert len(inside) == 3
    assert all(any(a - 0.01 <= t[w.start] and t[w.stop - 1] <= b + 0.01 for a, b in spans) for w in inside)


def test_no_window_where_the_speed_changes_or_another_coordinate_accelerates() -> None:
    t = np.arange(0.0, 6.0, 0.004)
    search = WindowSearch(0.3, 0.02, 0.01)
    none = np.zeros((t.size, 0))
    assert not constant_windows(t, 0.5 * np.sin(4 * t), none, WindowSearch(0.6, 0.02, 0.01)).windows
    assert not constant_windows(t, 0.1 * t**2, none, search).windows[:-1]
    assert not constant_windows(t, 0.2 * t + 0.004 * np.sin(40 * t), none, search).windows
    assert constant_windows(t, 0.2 * t, none, search).windows
    assert not constant_windows(t, 0.2 * t, np.sin(3 * t)[:, None], search).windows


@pytest.mark.parametrize(("noise", "sees"), [(0.0, True), (1e-5, True), (3e-3, False)])
def test_a_speed_that_settles_is_no_friction(noise: float, sees: bool) -> None:
    """Under a controller the speed is 20 mrad/s too high at first, with a time constant of 30 ms: 8 kg m^2 / 0.8 s."""
    t, excess, tau = np.arange(0.0, 0.8, 1e-3), 0.02, 0.03
    dz, ddz = 0.5 + excess * np.exp(-t / tau), -excess / tau * np.exp(-t / tau)
    z = -0.2 + 0.5 * t + excess * tau * (1 - np.exp(-t / tau))
    q, dq, ddq = (np.outer(x, [1.0, 0.0, 0.0, 0.0, 0.0]) for x in (z, dz, ddz))
    robot = irp6()
    effort = torques(robot, Samples(t, q, dq, ddq, ddq), 0)
    motor = robot.transmission.drives[0]
    effort[:, 0] += motor.ratio.value**2 * motor.rotor_inertia * ddz + 12.0
    q += np.random.default_rng(0).normal(0.0, 1.0, q.shape) * noise
    measured = drive_log(Log("run.csv", "", robot.joint_names, t, q, effort=effort), robot)
    windows = [ConstantWindow(0, t.size, 0.5)]
    (before,) = points_of(measured, "z1", windows, described_model(robot))
    (after,) = points_of(measured, "z1", windows, described_model(robot), settling=True)
    assert abs(before.torque - 12.0) > 0.1
    if sees:
        assert abs(after.torque - 12.0) < 0.2 * abs(before.torque - 12.0)
        assert after.deviation >= before.deviation
    else:
        assert after == before


def test_deviation_of_a_mean_counts_correlation_in_time() -> None:
    rng = np.random.default_rng(1)
    means, said = [], []
    for _ in range(300):
        white = rng.normal(size=420)
        coloured = np.convolve(white, np.ones(10) / 10, "valid")[:400]
        means.append(coloured.mean())
        said.append(mean_deviation(coloured))
    assert np.median(said) == pytest.approx(np.std(means), rel=0.2)
    assert np.median([mean_deviation(rng.normal(size=400)) for _ in range(100)]) == pytest.approx(0.05, rel=0.1)


def test_truth_lies_in_the_intervals_and_the_right_form_is_chosen() -> None:
    one = fitted(run())
    assert one.fit.form.name == "asymmetric stribeck (exponent 1)"
    for name, value, half in zip(one.fit.form.parameters, one.fit.values, one.fit.halfwidth, strict=True):
        assert abs(value - attrgetter(name)(TRUTH)) < 1.5 * half
    v = np.linspace(0.05, 0.8, 40)
    f, half = one.fit.band(v)
    assert np.all(np.abs(f - TRUTH.torque(v)) < 0.6)
    assert np.all(half < 1.0)


@pytest.mark.parametrize("stribeck", [False, True])
@pytest.mark.parametrize("asymmetric", [False, True])
def test_derivatives_by_the_parameters(stribeck: bool, asymmetric: bool) -> None:
    form = Form("any", stribeck, asymmetric, 1.5, True, 30.0, True)
    rng = np.random.default_rng(0)
    p = rng.uniform(0.3, 1.0, len(form.parameters))
    v, rise, load = np.r_[0.0, -0.0, rng.uniform(-1, 1, 18)], rng.uniform(-5, 5, 20), rng.uniform(0, 9, 20)
    at = Conditions(v, np.copysign(1.0, v), rise, load)
    _, J = form.values(p, at)
    for k in range(p.size):
        step = 1e-6 * np.eye(p.size)[k]
        slope = (form.values(p + step, at)[0] - form.values(p - step, at)[0]) / 2e-6
        assert J[:, k] == pytest.approx(slope, abs=1e-7)


def test_linear_intervals_are_those_of_the_normal_equations() -> None:
    rng = np.random.default_rng(5)
    v = np.r_[np.linspace(0.1, 1.0, 10), -np.linspace(0.1, 1.0, 10)]
    sigma = rng.uniform(0.1, 0.3, 20)
    tau = 10 * np.sign(v) + 5 * v + 1 + 0.5 * sigma * rng.normal(size=20)
    points = [Point(*row, 0.0, 0.3, 0) for row in zip(v, tau, sigma, strict=True)]
    found = fit(points, Form("plain"))
    A = np.column_stack([np.sign(v), v, np.ones(20)]) / sigma[:, None]
    assert found.values == pytest.approx(np.linalg.solve(A.T @ A, A.T @ (tau / sigma)), rel=1e-6)
    assert found.scatter < 1.0
    assert found.halfwidth == pytest.approx(2.5758 * np.sqrt(np.diag(np.linalg.inv(A.T @ A))), rel=1e-3)
    likely = (20 - 3) * found.scatter**2  # n = 20; p = 3 parameters, and the deviation for AICc [Hurvich, Tsai 1989]
    assert (found.bic, found.aicc) == pytest.approx((likely + 3 * np.log(20), likely + 2 * 4 * 20 / (20 - 4 - 1)))


def test_gravity_cancels_between_directions_over_the_same_path() -> None:
    curve = CoulombViscous(20.0, 26.0)
    one = fitted(run(curve, start=0.1), gravity="symmetric", model="coulomb-viscous")
    assert one.fit.values == pytest.approx([20.0, 26.0], abs=0.6)
    assert all(point.speed > 0 for point in one.points)
    assert any("offset" in note for note in one.notes)


def sine() -> list[tuple[float, float]]:
    """Accelerations of a motion there and back whose speed always changes."""
    up, down = [0.4, *([0.8] * 6), 0.4], [-0.4, *([-0.8] * 6), -0.4]
    return [(0.25, a) for a in [0.4, 0.8, 0.8, 0.4, *([*down, *up] * 3), *down]]


def test_a_motion_without_constant_speed_is_averaged_and_that_of_several_drives_only_if_asked() -> None:
    curve = CoulombViscous(20.0, 26.0)
    one = fitted(run(curve, sine(), start=0.0), model="coulomb-viscous", window=0.2)
    assert one.fit.values[:2] == pytest.approx([20.0, 26.0], rel=0.1)
    assert "changing speed" in " ".join(one.notes) or "mean speed" in " ".join(one.notes)
    log = run(curve, sine(), along=ALONG_Q2 + np.array([0.5, 0.0, 0.0, 0.0, 0.0]), start=0.0)
    with pytest.raises(InputError, match=r"z2: .* windows .* other drives move too; .*or give `speed='averaged'`"):
        fitted(log, window=0.2)
    asked = fitted(log, window=0.2, model="coulomb-viscous", speed="averaged")
    assert asked.fit.values[0] == pytest.approx(20.0, rel=0.15)


def test_a_table_takes_windows_of_one_speed_together() -> None:
    points = [Point(v, f, 0.1, 0.0, 0.3, 0) for v, f in ((0.1, 5.0), (0.101, 7.0), (0.5, 9.0), (-0.1, -4.0))]
    table = table_of(points)
    assert table.friction.tolist() == pytest.approx([-4.0, 6.0, 9.0])
    assert table.speed.tolist() == pytest.approx([-0.1, 0.1005, 0.5])


SPELLS = [(0.05, 4.0), *((0.1, 4.0 * (-1) ** (k + 1)) for k in range(40))]
ONE_WAY = [(0.05, 4.0), (1.5, 0.0), (0.05, -4.0), (0.3, 0.0), (0.1, 4.0), (0.8, 0.0), (0.1, -4.0)]


def test_what_cannot_be_fitted_says_what_is_missing() -> None:
    for log, settings, message in (
        (lambda: run(parts=[(4.0, 0.0)]), {}, r"z2: .*make runs at constant speed \(`plan_friction`"),
        (
            lambda: run(parts=SPELLS),
            {"speed": "constant"},
            "0 windows of 0.3 s .*make runs that keep one speed for 0.3",
        ),
        (lambda: run(parts=ONE_WAY), {}, "all 6 windows have positive speed.*add runs of negative speed"),
        (run, {"gravity": "none"}, "gravity does not cancel in the windows of z2.*`gravity='model'` subtr"),
        (
            lambda: replace(run(), temperature=np.tile(np.linspace(25.0, 25.4, run().count)[:, None], (1, 5))),
            {"temperature": "linear"},
            "temperature is constant, 25 to 25.4 deg C.*repeat the runs cold and warm",
        ),
        (run, {"temperature": "linear"}, "no temperature of every window.*record it"),
        (lambda: replace(run(), effort=None), {}, "no torques"),
        (lambda: run(parts=there_and_back((0.3,))), {"model": "stribeck"}, "do not determine|runs at more speeds"),
        (run, {"drive": "z9"}, "z9"),
    ):
        assert re.search(message, refusal(fitted, log(), **settings))


def test_without_a_model_gravity_has_to_be_cancelled() -> None:
    with pytest.raises(InputError, match="not known without a model; `gravity='model'`"):
        characteristics(irp6(), [run()], FitSettings(gravity="none"), None, ("z2",))
    with pytest.raises(InputError, match=r"does not state .*give `parameters`, the result of `identify`"):
        characteristics(unknown(), [run()], FitSettings(), described_model, ("z2",))


@pytest.mark.slow
@pytest.mark.parametrize("gravity", ["none", "auto"])
def test_a_drive_that_gravity_never_turns_needs_no_masses(gravity: str) -> None:
    """z1 turns about the vertical; z2, which gravity turns, is refused."""
    log = run(CoulombViscous(15.0, 20.0, 0.3), along=np.array([1.0, 0.0, 0.0, 0.0, 0.0]), drive=0)
    (one,) = characteristics(unknown(), [log], FitSettings(gravity=gravity), described_model, ("z1",))
    assert one.gravity == "none"
    assert one.fit.values == pytest.approx([15.0, 20.0, 0.3], abs=0.5)


def test_only_drives_that_the_logs_show_and_those_that_sway_beside_them_are_named() -> None:
    """One that sways has windows of constant speed of its own, but its friction is not what was measured."""
    (one,) = characteristics(irp6(), [run()], FitSettings(), described_model)
    assert one.drive == "z2"
    log = run(along=ALONG_Q2 + np.array([0.04, 0.0, 0.0, 0.0, 0.0]))
    (one,) = characteristics(irp6(), [log], FitSettings(), described_model)
    assert one.drive == "z2"
    assert "left out: z1, z3, z4, z5 move much less than the other drives" in one.notes
    assert fitted(log, "z1").drive == "z1"


@pytest.mark.slow
def test_the_command_writes_curves_that_read_back(here: Here) -> None:
    write_log(run(), here.cwd / "run.csv")
    fit = ("friction", "fit", "irp6", "run.csv", "--out")
    assert "asymmetric stribeck (exponent 1)" in here.run(*fit, "fit", "-v", status=0, stderr="").stdout
    folder = here.cwd / "fit"
    written = {"fit.json", "fit_curves.npz", "friction.yaml", "friction.png", "manifest.json"}
    assert {path.name for path in folder.iterdir()} == written
    curve = read_friction(folder / "friction.yaml").curve("z2")
    (drive,) = json.loads((folder / "fit.json").read_text())["characteristics"]
    assert isinstance(curve, Stribeck)
    assert curve.forward.coulomb == drive["fit"]["parameters"]["forward.coulomb"]["value"]
    write_friction(read_friction(folder / "friction.yaml"), here.cwd / "again.yaml")
    assert (here.cwd / "again.yaml").read_bytes() == (folder / "friction.yaml").read_bytes()
    assert "--force" in here.refused(*fit, "fit")
    asked = here.run(*fit, "table", "--drives", "2", "--model", "table", "--json")
    assert json.loads(asked.stdout)["characteristics"][0]["fit"] is None


def test_the_command_refuses(here: Here) -> None:
    log = run()
    write_log(log, here.cwd / "run.csv")
    write_log(replace(log, q=np.rad2deg(log.q)), here.cwd / "degrees.csv")
    write_log(log.rows(slice(0, 2)), here.cwd / "short.csv")
    for arguments, message in (
        (("degrees.csv",), "degrees"),
        (("short.csv",), "2 rows are too few"),
        (("run.csv", "--gravity", "symmetric", "--parameters", "res"), "--parameters is for --gravity model"),
        (("run.csv", "--parameters", "none"), "holds no result"),
        (("run.csv", "--joints", "q2"), "q2"),
    ):
        assert message in here.refused("friction", "fit", "irp6", *arguments, "--out", "fit")
        assert not (here.cwd / "fit").exists()


def test_paired_points_scatter_as_they_state() -> None:
    """Half the difference of two means of white noise over the same path, whose deviation is known."""
    robot, count, sigma = irp6(), 400, 0.3
    half = np.linspace(0.0, 1.0, count)
    q = np.zeros((2 * count, robot.n))
    q[:, 0] = np.concatenate([half, half[::-1]])
    time = np.arange(2 * count) / 100.0
    speed = 1.0 / (time[count - 1] - time[0])
    windows = [ConstantWindow(0, count, speed), ConstantWindow(count, 2 * count, -speed)]
    values, stated = [], []
    for seed in range(60):
        effort = sigma * np.random.default_rng(seed).standard_normal(q.shape)
        log = Log(source="x", sha256="", joints=robot.joint_names, time=time, q=q, effort=effort)
        measured = drive_log(log, robot)
        (point,) = paired_points(measured, measured.names[0], windows)
        values.append(point.torque)
        stated.append(point.deviation)
    assert np.mean(stated) == pytest.approx(sigma / np.sqrt(2 * count), rel=0.2)
    assert np.std(values) == pytest.approx(np.mean(stated), rel=0.35)


def test_motion_of_a_window_is_that_of_parabolas_through_its_positions() -> None:
    time, start = np.linspace(3.0, 3.6, 40), np.array([0.2, -0.1])
    speed, acceleration = np.array([0.3, -0.5]), np.array([0.04, 0.2])
    since = (time - time[0])[:, None]
    velocities, found = _parabola(time, start + speed * since + acceleration * since**2 / 2)
    np.testing.assert_allclose(velocities, speed + acceleration * since, atol=1e-12)
    np.testing.assert_allclose(found, acceleration, atol=1e-11)


@pytest.mark.parametrize("name", ["speed", "gravity", "model", "criterion", "temperature", "load", "stiction"])
def test_settings_of_few_values_are_refused_by_name(name: str) -> None:
    with pytest.raises(UnknownName, match=f"no {name} named 'magic'; available: "):
        FitSettings(**{name: "magic"})
