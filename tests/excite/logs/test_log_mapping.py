"""What a mapping converts: units, motors' sides, further files, joints of the robot; and garbage in the table."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
from motions import Sines
from refused import refusal
from written_files import text_file

from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from regressors.errors import InputError
from regressors.readers.library import built_in

HEAD = "header: false\ntime: {column: 1}\n"


@pytest.fixture
def written(tmp_path):
    return lambda content, name="log.csv": text_file(tmp_path / name, content)


def read(written, content, mapping, robot=None, **more):
    return read_log(written(content), mapping=written(mapping, "map.yaml"), robot=robot, **more)


def table(*columns):
    return "".join(",".join(f"{x:.17g}" for x in row) + "\n" for row in zip(*columns, strict=True))


def test_units(written):
    for channel, fields, cell, value in (
        ("position", "unit: deg", 180.0, np.pi),
        ("position", "unit: rev", 0.5, np.pi),
        ("position", "unit: ticks, ticks: 4096", 1024.0, np.pi / 2),
        ("position", "unit: ticks, ticks: 4096, ratio: 2, offset: 1024", 3072.0, np.pi / 2),
        ("command", "unit: ticks, ticks: 4096, ratio: 2, offset: 1024", 3072.0, np.pi / 2),
        ("velocity", "unit: rpm", 60.0, 2 * np.pi),
        ("velocity", "unit: deg/s", 90.0, np.pi / 2),
        ("velocity", "unit: ticks/s, ticks: 100", 50.0, np.pi),
        ("temperature", "unit: degC", 20.0, 20.0),
        ("temperature", "unit: K", 293.15, 20.0),
        ("temperature", "unit: K, offset: 273.15", 293.15, 20.0),
        ("temperature", "unit: degF", 68.0, 20.0),
    ):
        mapping = f"{HEAD}joints: [a]\n" + ("" if channel == "position" else "position: {columns: [2], unit: rad}\n")
        log = read(written, table([0.0, 1.0], [cell, cell]), f"{mapping}{channel}: {{columns: [2], {fields}}}\n")
        name = {"position": "q", "velocity": "dq"}.get(channel, channel)
        np.testing.assert_allclose(getattr(log, name), value, rtol=1e-12)


@pytest.mark.parametrize("time", ["rate: 8", "column: 1, rate: 8", "column: 1, unit: ms"])
def test_rows_at_a_rate_need_no_time(written, time):
    count, q = np.arange(5.0), np.linspace(0.1, 0.5, 5)
    mapping = f"joints: [a]\ntime: {{{time}}}\nposition: {{columns: [q], unit: rad}}\n"
    expected = count * 1e-3 if "ms" in time else count / 8
    log = read(written, "n,q\n" + table(count, q), mapping)
    np.testing.assert_array_equal((log.time, log.q[:, 0]), (expected, q))
    framed = Log.from_frame({"n": count, "q": q}, mapping=written(mapping, "map.yaml"))
    np.testing.assert_array_equal(framed.time, expected)
    np.savez(path := written("", "log.npz"), n=count, q=q)
    np.testing.assert_array_equal(read_log(path, mapping=written(mapping, "map.yaml")).time, expected)
    log = read(written, "n,q\n" + table(count, [0.1, np.nan, 0.3, 0.4, 0.5]), mapping, drop=("nan",))
    np.testing.assert_array_equal(log.time, np.delete(expected, 1))


def test_time_by_a_unit_or_by_a_rate(written):
    for time, message in (
        ("unit: s", r"time \(line 2\): needs the column of the time with its unit, or the rate of rows \[Hz\]"),
        ("column: 1, unit: s, rate: 8", r"time \(line 2\): needs the column of the time with its unit, or"),
        ("rate: 0", r"time.rate \(line 2\): must be a number from 1e-06"),
    ):
        with pytest.raises(InputError, match=message):
            read(written, table([0.0, 1.0], [0.0, 1.0]), f"joints: [a]\ntime: {{{time}}}\nposition: {{columns: [2]}}\n")


def test_bad_sections(written):
    for fields, message in (
        ("unit: ticks", "unit ticks needs the field ticks"),
        ("unit: rad, ticks: 9", "ticks is given, but the unit is not ticks"),
        ("unit: rad, side: load", "side"),
        ("unit: rad, file: q.csv", "positions are in the log itself"),
        ("unit: rad, gain: 0.0", "gain .*: must not be zero"),
        ("unit: rad, gain: [-1e-300]", "gain .*: must be 1e-15 or more, or -1e-15 or less"),
        ("unit: rad, ratio: 1e10", r"ratio .*: must be a number from -1e\+09 to 1e\+09"),
        ("unit: rad, columns: [0]", r"columns\[1\] \(line 4\): must be a whole number from 1 to"),
    ):
        columns = "" if "columns" in fields else "columns: [2], "
        with pytest.raises(InputError, match=message):
            read_mapping(written(f"{HEAD}joints: [a]\nposition: {{{columns}{fields}}}\n", "map.yaml"))


def motor_table(robot):
    """What motors of a robot measure along a motion: the table, its mapping, and the truth at the joints."""
    rng = np.random.default_rng(2)
    n = robot.n
    motion = Sines(np.zeros(n), 0.1 * rng.uniform(0.3, 1, (n, 2)), np.pi * np.arange(1, 3), rng.uniform(0, 6, (n, 2)))
    samples = motion.samples(np.arange(300) / 75)
    C, z0 = robot.transmission.coupling, robot.transmission.offset
    z, dz = samples.q @ C.T + z0, samples.dq @ C.T
    tau_z = rng.normal(size=z.shape)
    # independent of the gear's inverse: the angle is the integral of its rate, by Simpson's rule from z = 0
    phi, ratio = np.empty_like(z), np.empty_like(z)
    for (i, k), end in np.ndenumerate(z):
        x = np.linspace(0.0, end, 9)
        rates = [float(robot.transmission.drives[k].ratio.ratio(s)) for s in x]
        phi[i, k], ratio[i, k] = scipy.integrate.simpson(rates, x=x), rates[-1]
    columns = [samples.time, *phi.T, *(ratio * dz).T, *(tau_z / ratio).T]
    part = [list(range(2 + k * n, 2 + (k + 1) * n)) for k in range(3)]
    units = zip(("position", "velocity", "effort"), part, ("rad", "rad/s", "Nm"), strict=True)
    mapping = HEAD + "".join(f"{name}: {{columns: {cols}, unit: {unit}, side: motor}}\n" for name, cols, unit in units)
    return table(*columns), mapping, (samples.q, samples.dq, tau_z @ C)


@pytest.mark.parametrize("name", ["irp6", "irp6-full"])
def test_motors_through_gears_ball_screws_and_coupling(written, name):
    robot = built_in(name)
    offset = np.linspace(-0.1, 0.2, 5)
    robot = robot.replace(transmission=replace(robot.transmission, offset=offset))
    content, mapping, (q, dq, tau) = motor_table(robot)
    log = read(written, content, f"{mapping}command: {{columns: [2, 3, 4, 5, 6], unit: rad, side: motor}}\n", robot)
    np.testing.assert_array_equal(log.command, log.q)
    assert log.joints == robot.joint_names
    np.testing.assert_allclose(log.q, q, atol=2e-7)
    np.testing.assert_allclose(log.dq, dq, atol=2e-6)
    np.testing.assert_allclose(log.effort, tau, atol=1e-5)


def test_a_ratio_replaces_the_gear_and_keeps_the_coupling(written):
    robot = built_in("irp6")
    ratios = [2.0, 3.0, 4.0, 5.0, -6.0]
    z = np.random.default_rng(0).normal(size=(50, 5)) @ robot.transmission.coupling.T
    mapping = f"{HEAD}position: {{columns: [2, 3, 4, 5, 6], unit: rad, side: motor, ratio: {ratios}}}\n"
    log = read(written, table(np.arange(50.0), *(z * ratios).T), mapping, robot)
    np.testing.assert_allclose(log.q @ robot.transmission.coupling.T, z, atol=1e-12)


def test_what_needs_the_robot(written):
    motor = "position: {columns: [2], unit: rad, side: motor}"
    for mapping, robot, message in (
        ("position: {columns: [2], unit: rad}", None, "does not name its joints"),
        ("position: {columns: [2], unit: rad}", "irp6", "1 columns of one quantity for the 5 joints q1, q2"),
        (f"joints: [q1]\n{motor}", None, "no robot is given whose gears"),
        (f"joints: [q3]\n{motor}", "irp6", "drive .* also moves with q2"),
    ):
        with pytest.raises(InputError, match=message):
            read(written, table([0.0, 1.0], [0.0, 1.0]), f"{HEAD}{mapping}\n", robot and built_in(robot))
    mapping = f"{HEAD}position: {{columns: [2, 3, 4, 5, 6], unit: rad}}\n"
    log = read(written, table([0.0, 1.0], *np.zeros((5, 2))), mapping, built_in("irp6"))
    assert log.joints == built_in("irp6").joint_names


# --- one file per signal ---------------------------------------------------------------------------------------------

TWO_FILES = (
    f"{HEAD}joints: [a]\nposition: {{columns: [2], unit: rad}}\n"
    "effort: {columns: [2], unit: Nm, file: '{log}_tau.csv'}\n"
)


def test_signals_of_two_files_meet_on_the_rows_of_the_positions(written):
    time, other = np.arange(0, 2, 0.01), np.arange(0.05, 1.5, 0.003)
    assert re.search(r"cannot read log .*log_tau\.csv", refusal(read, written, table(time, time), TWO_FILES))
    written(table(other, 3 * other), "log_tau.csv")
    log = read(written, table(time, np.sin(time)), TWO_FILES)
    np.testing.assert_allclose(log.effort[:, 0], 3 * log.time, atol=1e-12)
    np.testing.assert_allclose(log.q[:, 0], np.sin(log.time))
    assert (log.time[0], log.time[-1]) == (pytest.approx(0.05), pytest.approx(1.49))
    (note,) = log.left_out
    gapped = np.setdiff1d(time, time[80:100])
    assert note.startswith("log_tau.csv: 484 rows, interpolated linearly onto the 145 of the positions; 55 of these")
    first = log.sha256
    written(table(other, 4 * other), "log_tau.csv")
    assert read(written, table(time, np.sin(time)), TWO_FILES).sha256 != first
    written(table(gapped, 3 * gapped), "log_tau.csv")
    log = read(written, table(time, np.sin(time)), TWO_FILES)
    np.testing.assert_array_equal(log.removed[0].numbers, np.arange(81, 101))
    written(table([50.0, 51.0], [0.0, 1.0]), "log_tau.csv")
    assert "one clock" in refusal(read, written, table([0.0, 1.0], [0.0, 1.0]), TWO_FILES)


def test_commands_of_another_file_hold_until_the_next_one(written):
    mapping = TWO_FILES + "command: {columns: [2], unit: rad, file: told.csv}\n"
    written(table([-1.0, 9.0], [0.0, 10.0]), "log_tau.csv")
    written(table([0.0, 1.0, 5.0], [7.0, 8.0, 9.0]), "told.csv")
    log = read(written, table([-0.5, 0.0, 0.9, 1.0, 3.0, 5.0, 8.0], np.zeros(7)), mapping)
    np.testing.assert_array_equal(log.command[:, 0], [7.0, 7.0, 8.0, 8.0, 9.0, 9.0])
    np.testing.assert_allclose(log.effort[:, 0], log.time + 1.0)
    assert log.left_out[0].startswith("told.csv: 3 rows, held onto the 6 of the positions; 1 of these are before")
    written(table([-9.0, -8.0], [7.0, 8.0]), "told.csv")
    assert "one clock" in refusal(read, written, table([0.0, 1.0], [0.0, 1.0]), mapping)


# --- garbage ---------------------------------------------------------------------------------------------------------

GARBAGE = ["# controller 3.2", "ERROR: buffer overrun", "1,2", "", "0.5,x,3,,,", "###,1,2"]


def lines(count=1000):
    return ["time,a.position,b.position", *(f"{k / 100},{k},{-k}" for k in range(count))]


@pytest.mark.parametrize("where", [1, 5, 400])
def test_a_few_garbage_lines_are_left_out_and_named(written, where):
    content = lines()
    content[where:where] = GARBAGE
    log = read_log(written("\n".join(content) + "\n"))
    np.testing.assert_array_equal(log.time, np.arange(1000) / 100)
    assert log.left_out == (f"6 lines hold no row of numbers: lines {where + 1} to {where + 6}",)
    np.testing.assert_array_equal(log.removed[0].numbers, np.arange(where, where + 6))
    np.testing.assert_array_equal(np.diff(log.row_numbers), np.where(np.arange(999) == where - 2, 7, 1))


def test_many_garbage_lines_are_refused_or_dropped_as_asked(written):
    content = lines(300)
    content[100:100] = GARBAGE
    path = written("\n".join(content) + "\n")
    assert re.search(r"line 101 has 1 columns, expected 3 .*`drop='garbage'`.*skip: N", refusal(read_log, path))
    assert read_log(path, drop=["garbage"]).count == 300


def test_lines_before_the_header_are_not_read(written):
    log = read_log(written("recorded by host 7\n\ntime of day: noon\n" + "\n".join(lines()) + "\n"))
    assert log.count == 1000
    assert log.left_out == ("3 lines before the header not read",)


@pytest.mark.parametrize("before", [["# head", "of text"], ["7 rows; version 2"]])
def test_a_table_without_header_may_begin_with_garbage(written, before):
    content = "\n".join([*before, *lines()[1:]]) + "\n"
    mapping = f"{HEAD}joints: [a, b]\nposition: {{columns: [2, 3], unit: rad}}\n"
    assert read(written, content, mapping).count == 1000
    assert read(written, content, f"{mapping}skip: {len(before)}\n").left_out == ()


def test_rows_that_are_not_asked_for_may_hold_anything(written):
    content = lines()
    content[900:] = [*["garbage"] * 100, "10,1000,-1000"]
    path = written("\n".join(content) + "\n")
    assert "100 lines like this" in refusal(read_log, path)
    log = read_log(path, only=(100, 500))
    np.testing.assert_array_equal(log.row_numbers, np.arange(100, 501))
    assert "rows: given 5:2000, but the log has 1000 rows" in refusal(read_log, path, only=(5, 2000))
