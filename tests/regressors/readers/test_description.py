"""Reader of robot descriptions: what it reads, and what it says about files that are wrong."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from refused import refusal

from regressors.errors import InputError, UnknownName
from regressors.readers.description import parse_description, read_description
from regressors.readers.description_schema import coefficient_of, coefficient_value
from regressors.robot.gears import BallScrew, ConstantRatio
from regressors.robot.inertia import from_centre_of_mass
from regressors.robot.robot import Robot

FULL = """\
name: two
source: a drawing
sources: {joints: the drawing, any.key: text}
gravity: 9.0
constants: {l1: 0.5, n: 10.0}
joints:
  - name: lift
    kind: prismatic
    mdh: {alpha: 90 deg, a: 0.1, d: 0.2, offset: 30 deg}
    limits: {position: [0.0, 1.5], velocity: 0.5, acceleration: 2, jerk: 20.0, torque: 1e+2}
  - name: turn
    kind: revolute
    pose: {xyz: [0.0, 0.0, 0.5], rpy: [0.0, 90 deg, 0.0], axis: [0.0, 0.0, 2.0]}
    limits: {position: [-170 deg, 1.0], velocity: 98 deg/s, acceleration: 1 deg/s^2, jerk: 2 deg/s^3}
links:
  - name: carriage
  - name: boom
    mass: 2.0
    com: [0.1, 0.0, 0.0]
    inertia: {about: centre-of-mass, xx: 0.1, yy: 0.2, zz: 0.2, xy: 0.01}
drives:
  - name: belt
    ratio: 50
    rotor_inertia: 1.0e-4
    friction: {coulomb: 3.0}
    limits: {position: [-10 deg, 10 deg]}
  - name: screw
    ratio: {ball_screw: {pitch: 0.005, square: 0.08, cosine: -0.03, sine: 0.05}}
    offset: 5 deg
coupling: [[1, 0], [0.5, 1]]
structure:
  zero: [m2c2y]
  equal: [[I2yy, I2zz]]
  aggregates:
    - joints: [turn, lift]
      parameters:
        X1: {I2zz: 1, Ia1: n^2, m2: -2*l1}
"""

MINIMAL = "name: one\njoints:\n  - name: a\n    mdh: {d: 1.0}\n"


@pytest.fixture(scope="module")
def two() -> Robot:
    return parse_description(FULL, "two.yaml")


def test_reads_joints_and_limits(two: Robot) -> None:
    assert (two.name, two.source, two.joint_names) == ("two", "a drawing", ("lift", "turn"))
    assert np.array_equal(two.gravity, [0, 0, -9])
    assert dict(two.constants) == {"l1": 0.5, "n": 10.0}
    lift, turn = two.joints
    assert (lift.kind, turn.kind) == ("prismatic", "revolute")
    assert np.allclose(lift.translation, [0.1, -0.2, 0.0], atol=1e-15)
    assert np.allclose(lift.rotation[:, 0], [np.cos(np.pi / 6), 0, np.sin(np.pi / 6)])
    assert np.array_equal(turn.translation, [0, 0, 0.5])
    assert np.allclose(turn.rotation, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=1e-15)
    assert np.array_equal(turn.axis, [0, 0, 1])
    limits = two.limits
    assert np.array_equal([limits.lower, limits.upper], [[0.0, np.deg2rad(-170)], [1.5, 1.0]])
    assert np.array_equal([limits.velocity, limits.acceleration], [[0.5, np.deg2rad(98)], [2.0, np.deg2rad(1)]])
    assert np.array_equal([limits.jerk, limits.torque], [[20.0, np.deg2rad(2)], [100.0, np.inf]])


def test_reads_links_drives_and_structure(two: Robot) -> None:
    carriage, boom = two.links
    assert (carriage.name, carriage.theta) == ("carriage", None)
    tensor = [[0.1, 0.01, 0], [0.01, 0.2, 0], [0, 0, 0.2]]
    assert np.allclose(boom.theta, from_centre_of_mass(2.0, [0.1, 0, 0], tensor), rtol=1e-15)
    belt, screw = two.transmission.drives
    assert (belt.name, belt.ratio, belt.rotor_inertia) == ("belt", ConstantRatio(50.0), 1e-4)
    assert (belt.coulomb, belt.viscous) == (3.0, None)
    assert (screw.name, screw.ratio, screw.rotor_inertia) == ("screw", BallScrew(0.005, 0.08, -0.03, 0.05), None)
    assert np.array_equal(two.transmission.coupling, [[1, 0], [0.5, 1]])
    assert np.array_equal(two.transmission.offset, [0, np.deg2rad(5)])
    assert np.array_equal(two.transmission.limits.upper, [np.deg2rad(10), np.inf])
    assert (two.structure.zero, two.structure.equal) == ({"m2c2y"}, (("I2yy", "I2zz"),))
    (form,) = two.structure.aggregates
    assert form.joints == ("lift", "turn")  # in the robot's order, whatever the file's
    assert form.parameters == {"X1": {"I2zz": 1.0, "Ia1": 100.0, "m2": -1.0}}


def test_what_is_not_given_is_not_known() -> None:
    robot = parse_description(MINIMAL, "one.yaml")
    assert robot.source == "one.yaml"
    assert np.array_equal(robot.gravity, [0, 0, -9.81])
    assert robot.transmission is None
    assert [(link.name, link.theta) for link in robot.links] == [("link1", None)]
    assert np.array_equal(robot.limits.lower, [-np.inf])
    assert all(np.array_equal(getattr(robot.limits, name), [np.inf]) for name in ("upper", "velocity", "torque"))
    assert robot.structure.zero == frozenset()
    more = parse_description(MINIMAL + "gravity: [0, 9.81, 0]\ndrives: [{name: z}]\n", "one.yaml")
    assert np.array_equal(more.gravity, [0, 9.81, 0])
    assert (more.transmission.coupling.tolist(), more.transmission.drives[0].ratio) == ([[1.0]], ConstantRatio(1.0))


def test_first_moment_and_origin_are_the_other_way_to_write_a_link() -> None:
    one = "{name: l, mass: 2.0, com: [0.1, 0.2, 0.3], inertia: {about: centre-of-mass, xx: 1, yy: 2, zz: 2.5}}"
    about = from_centre_of_mass(2.0, [0.1, 0.2, 0.3], np.diag([1, 2, 2.5]))
    elements = zip(("xx", "xy", "xz", "yy", "yz", "zz"), about[4:].tolist(), strict=True)
    tensor = ", ".join(f"{name}: {value!r}" for name, value in elements)
    other = f"{{name: l, mass: 2, first_moment: [0.2, 0.4, 0.6], inertia: {{about: origin, {tensor}}}}}"
    thetas = [parse_description(f"{MINIMAL}links: [{link}]\n", "x").links[0].theta for link in (one, other)]
    assert np.allclose(thetas[0], about, rtol=1e-15)
    assert np.allclose(thetas[0], thetas[1], rtol=1e-15)


LINK = "name: l, mass: 2.0, com: [0.1, 0.2, {}], inertia: {{about: centre-of-mass, xx: 1, yy: 2, zz: 2.5}}"
TURNED = "frame: {xyz: [1.0, 0.0, 0.0], rpy: [90 deg, 0.0, 0.0]}"


def test_link_in_another_frame() -> None:
    link = parse_description(f"{MINIMAL}links: [{{{LINK.format(0.3)}, {TURNED}}}]\n", "x").links[0]
    R = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    theta = from_centre_of_mass(2.0, R @ [0.1, 0.2, 0.3] + [1, 0, 0], R @ np.diag([1, 2, 2.5]) @ R.T)
    assert np.allclose(link.theta, theta, atol=1e-14)


def test_zero_in_a_turned_frame_is_zero() -> None:
    text = f"{MINIMAL}links: [{{{LINK.format(0)}, {TURNED}}}]\nstructure: {{zero: [m1c1y]}}\n"
    (link,) = parse_description(text, "x").links
    assert 0 < abs(link.theta[2]) < 1e-15


def test_hash_is_that_of_the_content() -> None:
    robot = parse_description(FULL, "two.yaml")
    rewritten = FULL.replace("90 deg", repr(math.pi / 2)).replace("source: a drawing", "source: another drawing")
    rewritten = "# a comment\n" + rewritten.replace("any.key: text", "any.key: other").replace("[m2c2y]", "\n  - m2c2y")
    assert rewritten != FULL
    assert parse_description(rewritten, "elsewhere.yaml").sha256() == robot.sha256()
    assert parse_description(FULL.replace("mass: 2.0", "mass: 2.1"), "two.yaml").sha256() != robot.sha256()


finite = st.floats(-10, 10, allow_nan=False).map(lambda x: x + 0.0)


@settings(deadline=None)
@given(
    st.fixed_dictionaries(dict.fromkeys(("alpha", "a", "d", "offset"), finite)),
    finite,
    st.floats(0.1, 5),
    st.floats(0.1, 9),
)
def test_numbers_survive_the_text(mdh: dict[str, float], lower: float, span: float, velocity: float) -> None:
    upper, place = lower + span, ", ".join(f"{name}: {value!r}" for name, value in mdh.items())
    limits = f"limits: {{position: [{lower!r}, {upper!r}], velocity: {velocity!r}}}"
    robot = parse_description(f"name: r\njoints: [{{name: j, mdh: {{{place}}}, {limits}}}]\n", "r.yaml")
    (joint,), limits = robot.joints, robot.limits
    expected = type(joint).from_mdh("j", "revolute", **mdh)
    assert np.array_equal(joint.rotation, expected.rotation)
    assert np.array_equal(joint.translation, expected.translation)
    assert (limits.lower[0], limits.upper[0], limits.velocity[0]) == (lower, upper, velocity)


# What is wrong, as a change of FULL or as a whole file, and what the message must say --------------------------------

PLACE = "    pose: {xyz: [0.0, 0.0, 0.5], rpy: [0.0, 90 deg, 0.0], axis: [0.0, 0.0, 2.0]}\n"
CHANGES = [
    ("name: two", "name: 2", "name (line 1): should be a valid string, given 2"),
    ("name: two", "nam: two", "name (line 1): is missing; nam (line 1): no such field; did you mean name? available:"),
    ("gravity: 9.0", "gravity: 9.0\ngravity: 9.81", "gravity (line 4): is given twice, again in line 5"),
    ("l1: 0.5", "l1: .inf", "constants.l1 (line 5): should be a finite number, given inf"),
    ("l1: 0.5", "1l: 0.5", "a constant's name holds letters, digits and '_' only, given '1l'"),
    ("alpha: 90 deg", "alpha: 90 grad", "mdh.alpha (line 9): expected a number or text such as '90 deg', given '90 gr"),
    ("kind: prismatic", "kind: sliding", "joints[1].kind (line 8): should be 'revolute' or 'prismatic', given 'slidin"),
    ("position: [0.0, 1.5]", "position: [0 deg, 9 deg]", "limits (line 10): the limits of a prismatic joint are in me"),
    ("position: [0.0, 1.5]", "position: [1.5, 0.0]", "position (line 10): lower bound 1.5 must be below the upper bou"),
    ("name: turn", "name: lift", "joints[2].name (line 11): the name 'lift' is given twice"),
    ("name: turn", "name: the turn", "joints[2].name (line 11): a name must not be empty nor hold spaces or commas"),
    (PLACE, "", "joints[2] (line 11): joint 'turn' needs mdh or pose, and not both"),
    ("axis: [0.0, 0.0, 2.0]", "axis: [0, 0, 0]", "pose.axis (line 13): an axis needs a length that is not zero"),
    ("    mass: 2.0\n", "", "links[2] (line 17): link 'boom': give mass, com or first_moment, and inertia, or none; n"),
    ("    com:", "    first_moment: [1, 0, 0]\n    com:", "links[2] (line 17): link 'boom': give com or first_moment"),
    ("  - name: carriage\n", "", "links (line 15): expected as many links as joints, 2, given 1"),
    ("ratio: 50", "ratio: fast", "drives[1].ratio (line 23): expected a number or a ball_screw, given 'fast'"),
    ("coupling: [[1, 0], [0.5, 1]]", "coupling: [[1, 0]]", "coupling (line 30): expected as many rows as drives, 2, "),
    ("[0.5, 1]]", "[0.5]]", "coupling[2] (line 30): expected as many columns as joints, 2, given 1"),
    ("zero: [m2c2y]", "zero: [m2]", "structure.zero[1] (line 32): m2 is declared zero, but its link gives 2"),
    ("zero: [m2c2y]", "zero: [I2zz]", "structure.equal[1][2] (line 33): I2zz is already declared zero or equal"),
    ("[I2yy, I2zz]", "[I2xx, I2zz]", "equal[1] (line 33): are declared equal, but the links give I2xx = 0.1, I2zz"),
    ("joints: [turn, lift]", "joints: [turn, grip]", "no joint named 'grip'; available: lift, turn"),
    ("Ia1: n^2", "Ia1: n^2 + 1", "parameters.X1.Ia1 (line 37): expected a number or a product such as '-2*l2*n1^2'"),
    ("Ia1: n^2", "Ia1: .nan", "X1.Ia1 (line 37): expected a finite number or a product such as '-2*l2*n1^2', given na"),
    ("Ia1: n^2", "Ia7: n^2", "structure.aggregates[1].parameters.X1.Ia7 (line 37): no parameter named 'Ia7'"),
]


@pytest.mark.parametrize(("old", "new", "message"), CHANGES)
def test_refuses_and_says_why(old: str, new: str, message: str) -> None:
    assert old in FULL
    assert message in refusal(parse_description, FULL.replace(old, new, 1), "two.yaml", begins="two.yaml: ")


WHOLE = [
    ("name: x\n joints: [\n", "f.yaml, line 2: not valid YAML: mapping values are not allowed here"),
    ("name: x\n---\nname: y\n", "f.yaml, line 2: not valid YAML: but found another document"),
    ("name: x\nsource: \x01\n", "f.yaml, line 2: not valid YAML: character '\\x01'"),
    ("%YAML 1.1\n---\nname: x\n", "f.yaml, line 1: YAML directives are not supported, given '%YAML 1.1'"),
    ("name: !!python/object:os.system x\n", "f.yaml: name (line 1): YAML tags are not supported, given 'tag:yaml.org"),
    ("name: &a x\nsource: *a\n", "f.yaml: name (line 1): anchors and aliases (&name, *name) are not supported"),
    ("? [a, b]\n: 1\n", "f.yaml: the file (line 1): a field's name must be text (line 1)"),
    ("robot: irp6\nperiod: 5\n", "f.yaml names a robot and describes none; give that robot, and this file as `task`"),
    ("[" * 500, "f.yaml: lists and mappings are nested too deeply"),
    (MINIMAL + "drives: [{name: y}, {name: z}]\n", "f.yaml: drives (line 5): 2 drives of 1 joints need a coupling"),
    (MINIMAL + "coupling: [[1]]\n", "f.yaml: coupling (line 5): a coupling needs drives"),
]


@pytest.mark.parametrize(("text", "message"), WHOLE)
def test_refuses_whole_files(text: str, message: str) -> None:
    assert message in refusal(parse_description, text, "f.yaml", begins="f.yaml")


def test_tells_everything_at_once_in_the_order_of_lines() -> None:
    text = FULL.replace("ratio: 50", "ratio: 0").replace("velocity: 0.5", "velocity: no").replace("name: two", "nam: 1")
    told = refusal(parse_description, text, "two.yaml").split("; ")
    places = ["two.yaml", "nam (line 1)", "joints[1].limits.velocity (line 10)", "drives[1].ratio (line 23)"]
    assert [part.split(":")[0] for part in told if "(line" in part] == places


def complaint(text: str) -> str:
    try:
        parse_description(text, "f.yaml")
    except InputError as error:
        return str(error)
    return ""


@settings(deadline=None)
@given(st.sampled_from(FULL.split()), st.text(max_size=8))
def test_any_change_gives_a_robot_or_one_line(old: str, new: str) -> None:
    assert "\n" not in complaint(FULL.replace(old, new, 1))


def test_refuses_files_that_cannot_be_read(tmp_path: Path) -> None:
    assert re.search(r"cannot read '.*none\.yaml': No such file", refusal(read_description, tmp_path / "none.yaml"))
    assert re.search(r"cannot read .*: Is a directory", refusal(read_description, tmp_path))
    path = tmp_path / "binary.yaml"
    path.write_bytes(b"name: \xff\n")
    assert "binary.yaml': not a text file in UTF-8 (byte 7)" in refusal(read_description, path)


# Coefficients --------------------------------------------------------------------------------------------------------

CONSTANTS = {"l2": 0.5, "n1": 10.0, "zero": 0.0, "big": 1e300}


COEFFICIENTS = {
    "1": 1.0, "-1": -1.0, "+2.5": 2.5, ".5e1": 5.0, "2.": 2.0, "l2": 0.5, "-l2": -0.5, "l2^2": 0.25, "l2^-1": 2.0,
    "2*l2*n1^2": 100.0, " - 2 * l2 * n1^2 ": -100.0, "l2*l2*4": 1.0, "l2^0": 1.0, "zero^2": 0.0,
}  # fmt: skip
NO_COEFFICIENTS = [
    "", " ", "-", "*", "l2*", "*l2", "2**3", "l2**2", "l2^", "l2^x", "l2^2.5", "l2^100", "2^3", "--2", "+-2", "2*-l2",
    "l2 n1", "l2/n1", "l2+n1", "(l2)", "2l2", "l2.x", "0x10", "1_0", "nan", "inf*", "1e999", "l²", "٣", "l2\n*n1;",
    "__import__('os')",
]  # fmt: skip


def test_coefficient() -> None:
    assert {text: coefficient_value(coefficient_of(text), CONSTANTS) for text in COEFFICIENTS} == COEFFICIENTS


def test_coefficients_that_cannot_be() -> None:
    for text in NO_COEFFICIENTS:
        refusal(lambda text=text: coefficient_value(coefficient_of(text), CONSTANTS))
    for text in ("zero^-1", "big^2", "big*big", "1e300*big"):
        assert "coefficient is not a finite number" in refusal(coefficient_value, coefficient_of(text), CONSTANTS)
    with pytest.raises(UnknownName, match="no constant named 'k'; available: l2, n1, zero, big"):
        coefficient_value(coefficient_of("k"), CONSTANTS)


names = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,3}", fullmatch=True)
powers = st.lists(st.tuples(names, st.floats(0.1, 3), st.integers(-4, 4)), max_size=5, unique_by=lambda p: p[0])


@settings(deadline=None)
@given(st.sampled_from(["", "-", "+", " - "]), st.lists(st.floats(1e-3, 100), max_size=3), powers, st.randoms())
def test_products_are_products(sign: str, numbers: list[float], factors: list[tuple[str, float, int]], rng) -> None:
    if not numbers and not factors:
        numbers = [1.0]
    written = [repr(x) for x in numbers] + [name if e == 1 else f"{name}^{e}" for name, _, e in factors]
    rng.shuffle(written)
    expected = math.prod(numbers) * math.prod(value**e for _, value, e in factors)
    found = coefficient_value(coefficient_of(sign + " * ".join(written)), {name: value for name, value, _ in factors})
    assert math.isclose(found, -expected if "-" in sign else expected, rel_tol=1e-12)


def motor_limits(text: str, ratio: str = "-50") -> str:
    return MINIMAL + f"drives: [{{name: z, ratio: {ratio}, {text}}}]\n"


def test_limits_of_a_motor_are_those_of_its_coordinate_behind_the_gear() -> None:
    stated = "motor_limits: {position: [-100, 50], velocity: 3000 rpm, acceleration: 5000, jerk: 1.0e+6, torque: 2}"
    robot = parse_description(motor_limits(stated), "f.yaml")
    found = np.ravel(list(vars(robot.transmission.limits).values()))
    np.testing.assert_allclose(found, (-1.0, 2.0, 2 * np.pi, 100.0, 2.0e4, 100.0), rtol=1e-14)
    mixed = parse_description(motor_limits("limits: {torque: 80}, motor_limits: {velocity: 100}"), "f.yaml")
    assert (mixed.transmission.limits.torque[0], mixed.transmission.limits.velocity[0]) == (80.0, 2.0)


SCREW = "{ball_screw: {pitch: 0.005, square: 1, cosine: 0, sine: 0.1}}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (motor_limits("limits: {torque: 1}, motor_limits: {torque: 2}"), "limits and motor_limits both state torque"),
        (motor_limits("motor_limits: {torque: 2}", SCREW), "motor_limits need a constant ratio"),
        (motor_limits("motor_limits: {velocity: fast rpm}"), "expected a number of rpm, given 'fast rpm'"),
        (motor_limits("motor_limits: {position: [1, -1]}"), "lower bound 1 must be below the upper bound -1"),
    ],
)
def test_limits_of_a_motor_that_cannot_be_are_refused(text: str, message: str) -> None:
    assert message in refusal(parse_description, text, "f.yaml")
