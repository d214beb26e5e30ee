"""Bad input: one clear line that says what was given, what was expected and what there is; exit 2; nothing written."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from commands import ENVIRONMENT, SCRIPT, Here, files_below, run

from excite.design.formulation import formulate
from excite.tasks.task import Task
from regressors.readers.library import built_in_names, load_robot

IRP6 = (Path(__file__).resolve().parents[3] / "regressors" / "robots" / "irp6.yaml").read_text(encoding="utf-8")
ONE = "name: one\njoints: [{{name: a, mdh: {{}}, limits: {{{limits}}}}}]\n{more}"
FULL = "position: [-1, 1], velocity: 1, acceleration: 1"
ARM = """\
<robot name="arm">
  <link name="base"/><link name="upper"/><link name="left"/><link name="right"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/></joint>
  <joint name="l" type="revolute"><parent link="upper"/><child link="left"/></joint>
  <joint name="r" type="revolute"><parent link="upper"/><child link="right"/></joint>
</robot>
"""
BOMB = """\
<?xml version="1.0"?>
<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;">]>
<robot name="&c;"><link name="base"/></robot>
"""


@dataclass(frozen=True)
class Case:
    """A command, the files that it meets, and the parts of its one line on stderr, in order."""

    arguments: tuple[str, ...]
    message: tuple[str, ...]
    files: dict[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return " ".join(self.arguments)


def irp6(options: str, *message: str) -> Case:
    return Case(("design", "irp6", *options.split(), "--out", "out"), message)


def task(text: str, *message: str) -> Case:
    return Case(("design", "irp6", "--task", "task.yaml", "--out", "out"), message, {"task.yaml": text})


def file(name: str, text: str, options: str, *message: str) -> Case:
    return Case(("design", name, *options.split(), "--out", "out"), message, {name: text})


def plain(command: str, *message: str) -> Case:
    return Case(tuple(command.split()), message)


HELP = "see 'excite design --help'"
NUMBERS = ("expected numbers separated by commas, such as 2.5,2,2, given ", HELP)
FIVE = "for the joints q1, q2, q3, q4, q5; given 2"
COMMANDS = (
    plain(
        "desing irp6 --out out",
        "no command named 'desing'; did you mean design? available: robots, design, ",
        "compare, bound; see 'excite --help'",
    ),
    plain("--bogus", "No such option", "--bogus", "see 'excite --help'"),
    plain("design", "Missing argument 'ROBOT'", HELP),
    plain("design irp6", "Missing option '--out'", HELP),
    plain("design irp6 again --out out", "unexpected extra argument (again)", HELP),
    plain("design irp6 --bogus --out out", "No such option", "--bogus", HELP),
    plain("design irp6 --out", "Option '--out' requires an argument"),
    Case(("design", "irp6", "--out", ""), ("'--out': expected the name of a folder, given ''", HELP)),
    plain("robots nope", "no robot 'nope': built-in robots are ", "a file of that name does not exist"),
    plain("robots irp6 --joints 9", "no joint named '9'; available: 1 (q1), 2 (q2), 3 (q3), 4 (q4), 5 (q5)"),
    plain(
        "robots irp6 --tip tool0",
        "--base and --tip choose a chain of a URDF, xacro or MJCF file, but 'irp6' is none",
    ),
    plain("plan", "Missing argument 'ROBOT'", "see 'excite plan --help'"),
    plain("plan nope", "no robot 'nope': built-in robots are "),
    plain("plan irp6 --joints 9", "no joint named '9'; available: 1 (q1)"),
    plain("plan irp6 --at-once 0", "'--at-once': must be a whole number from 1 to 1000, given 0"),
    plain(
        "plan panda --no-friction --at-once 1",
        "motions of at most 1 drive(s) at a time do not identify all 43 parameters",
    ),
    plain("plan irp6 --after r", "--after is for the next motion", "give --precision too", "see 'excite plan --help'"),
    plain("plan irp6 --of measured", "--of is for the next motion towards a precision"),
    plain("plan irp6 --precision 5% --after nowhere", "--after: nowhere holds neither result.json nor design.json"),
    plain("plan irp6 --precision 0", "'--precision': must be"),
    plain("plan irp6 --precision 5% --of hoped", "'--of': 'hoped' is not one of"),
    plain("design irp6 --after nowhere --out out", "--after: nowhere holds neither result.json nor design.json"),
    plain("design irp6 --after , --out out", "'--after': expected names"),
    plain("compare nothing --model best", "'--model': 'best' is not one of", "see 'excite compare --help'"),
    plain("compare", "Missing argument 'DIR...'", "see 'excite compare --help'"),
    plain("compare nothing", "nothing holds no design: there is no nothing/design.json"),
)
OPTIONS = (
    irp6("--joints q9", "no joint named 'q9'; available: 1 (q1), 2 (q2), 3 (q3), 4 (q4), 5 (q5)"),
    irp6("--joints 1,0", "no joint named '0'; available: 1 (q1)"),
    irp6("--joints 1,,3", "'--joints': expected names or numbers separated by commas, such as 1,3; given '1,,3'", HELP),
    irp6("--velocity-limit 0", "'--velocity-limit': must be a number from 1e-09 to 1000000 rad/s or m/s, given 0"),
    irp6(
        "--acceleration-limit=-1",
        "'--acceleration-limit': must be a number from 1e-09 to 1e+09 rad/s^2 or m/s^2, given -1",
    ),
    irp6("--jerk-limit 1,1,0,1,1", "'--jerk-limit': must be a number from 1e-09 to 1e+12 rad/s^3 or m/s^3, given 0"),
    irp6("--velocity-limit nan", "'--velocity-limit': expected finite numbers, given 'nan'", HELP),
    irp6("--acceleration-limit inf", "'--acceleration-limit': expected finite numbers, given 'inf'", HELP),
    irp6("--velocity-limit fast", "'--velocity-limit': ", *NUMBERS),
    irp6("--velocity-limit 1,2", f"limits: velocity needs one value, or 5 {FIVE}"),
    irp6("--jerk-limit 1,2", f"limits: jerk needs one value, or 5 {FIVE}"),
    irp6("--position-limit 0:1", "limits: position needs 5 pairs, one per joint, given 1"),
    irp6("--position-limit 1:0,0:1,0:1,0:1,0:1", "joint q1: lower position limit 1 must be below the upper one 0"),
    irp6("--position-limit 0:1,0:nan", "expected LOWER:UPPER per joint, such as -1:1,-2:0.5; given '0:1,0:nan'", HELP),
    irp6("--position-limit 1", "expected LOWER:UPPER per joint", "given '1'", HELP),
    irp6(
        "--harmonics 0",
        "'--harmonics': must be a whole number from 1 to 1000, given 0",
    ),
    irp6("--harmonics 1", "harmonics: 1 are too few for a motion at rest at both ends; expected 2 or more"),
    irp6("--harmonics 2.5", "'--harmonics': expected auto or a whole number, given '2.5'", HELP),
    irp6("--harmonics 500", "10 s at 100 Hz is 1000 samples, too few for 500 harmonics; expected a rate above 100 Hz"),
    irp6("--period -1", "'--period': must be a number from 0.001 to 100000 s, given -1"),
    irp6("--period 0", "'--period': must be a number from 0.001 to 100000 s, given 0"),
    irp6("--period nan", "'--period': must be a number from 0.001 to 100000 s, given nan"),
    irp6("--period long", "'--period': expected a number, given 'long'", HELP),
    irp6(
        "--period 9.999",
        "9.999 s at 100 Hz is 999.9 samples, not a whole number; the nearest period is 10 s",
    ),
    irp6("--rate 0", "'--rate': must be a number from 1e-06 to 10000000 Hz, given 0"),
    irp6("--rate 0.01", "10 s at 0.01 Hz is 0.1 samples, not a whole number"),
    irp6("--rate inf", "'--rate': must be a number from 1e-06 to 10000000 Hz, given inf"),
    irp6("--rate 1e9", "'--rate': must be a number from 1e-06 to 10000000 Hz, given 1e+09"),
    irp6("--rate 1e300 --period 1e10", "'--rate': must be a number from 1e-06 to 10000000 Hz, given 1e+300"),
    irp6("--starts 0", "'--starts': must be a whole number from 1 to 10000000, given 0"),
    irp6("--seed -1", "'--seed': must be a whole number from 0 to 2^63 - 1, given -1"),
    irp6("--workers 0", "'--workers': must be a whole number from 1 to 10000, given 0"),
    irp6("--noise 0", "'--noise': must be a number from 1e-12 to 1e+12, given 0"),
    irp6("--noise 1,-2", "'--noise': must be a number from 1e-12 to 1e+12, given -2"),
    irp6("--noise inf", "'--noise': expected finite numbers, given 'inf'", HELP),
    irp6("--noise quiet", "'--noise': ", *NUMBERS),
    irp6("--noise 1,2", "noise needs one value, or 3 for ", "q1, q2, q3; given 2"),
    irp6("--model kinematic", "'--model': 'kinematic' is not", "differential", HELP),
    irp6("--trajectory circle", "'--trajectory': 'circle' is not", "fourier", HELP),
    irp6("--criterion best", "'--criterion': 'best' is not", "condition", HELP),
    irp6("--solver magic", "'--solver': 'magic' is not one of sqp, ipopt, slsqp, nor module:Name of your own", HELP),
    irp6("--executor cloud", "'cloud' is not one of process, serial, dask://HOST:PORT, dask-file:PATH, dask-loc", HELP),
    irp6("--format xml", "'--format': 'xml' is not one of 'text', 'json'", HELP),
    irp6("--tip tool0", "--base and --tip choose a chain of a URDF, xacro or MJCF file, but 'irp6' is none"),
    irp6("--xacro", "--xacro expands a file that ends in .urdf, .xml, .xacro, .mjcf, but 'irp6' is none of them"),
    irp6(
        "--base piovted", "--base 'piovted': expected one of gautier, pivoted, orthonormal, or the base link of a URDF"
    ),
    irp6("--drives 9", "no drive named '9'; available: 1 (z1), 2 (z2), 3 (z3)"),
    irp6("--drives 1 --joints 1", "--joints and --drives exclude each other; give one of them"),
    irp6("--drives 2 --require X1", "X1 is not identifiable from motions of z2; move z1, which identifies it"),
    irp6("--require X9", "no parameter named 'X9'; available: X1, X2"),
    irp6("--model energy --window-length 0", "'--window-length': must be a number from 1e-06 to 100000 s, given 0"),
    irp6("--model energy --window-length 20", "a window of 20 s is longer than the motion of 10 s"),
    irp6("--model load --sensor hand", "named 'hand'; available: 1 (column), 2 (arm)"),
    irp6(
        "--model load --sensor-xyz 1,2", "'--sensor-xyz': expected three numbers separated by commas, given '1,2'", HELP
    ),
    irp6("--model load --sensor-rpy 0,0,nan", "'--sensor-rpy': expected finite numbers, given '0,0,nan'", HELP),
    irp6("--model load --equations fq", "no equation named 'fq'; available: fx, fy, fz, nx, ny, nz"),
    irp6("--start lying", "no start named 'lying'; available: random, cosine, quintic, sines"),
    irp6("--base gautier --base pivoted", "--base names more than one convention: gautier, pivoted", HELP),
    irp6("--base a --base b", "--base names more than one base link: a, b", HELP),
)
TASKS = (
    Case(
        ("design", "irp6", "--task", "none.yaml", "--out", "out"),
        ("cannot read task file none.yaml: No such file or directory",),
    ),
    Case(("design", "irp6", "--task", ".", "--out", "out"), ("cannot read task file .: Is a directory",)),
    Case(
        ("design", "irp6", "--task", "two\nlines", "--out", "out"), ("cannot read task file two lines: No such file",)
    ),
    task(
        "harmonics: 3\nperod: 3\n",
        "task.yaml: perod (line 2): no such field; did you mean period? available: ",
        "limits",
    ),
    task("limits:\n  speed: 3\n", "limits.speed (line 2): no such field; available: position, velocity, acceleration"),
    task("harmonics: [\n", "task.yaml, line ", "not valid YAML"),
    task("harmonics: 3\n harmonics: 4\n", "task.yaml, line 2: not valid YAML"),
    task("harmonics: 3\nharmonics: 4\n", "task.yaml: harmonics (line 1): is given twice, again in line 2"),
    task("", "task.yaml: expected a mapping of fields, given nothing"),
    task("- 3\n", "task.yaml: expected a mapping of fields, given a list of 1"),
    task("harmonics: many\n", "task.yaml: harmonics (line 1): should be a whole number, or auto", "given 'many'"),
    task("period: .nan\n", "task.yaml: period (line 1): should be a finite number, given nan"),
    task("limits: {velocity: .inf}\n", "task.yaml: limits.velocity[1] (line 1): should be a finite number, given inf"),
    task("limits: {velocity: fast}\n", "task.yaml: limits.velocity (line 1): should be a valid list, given 'fast'"),
    task(
        "limits: {position: [[0, 1, 2]]}\n",
        "limits.position[1] (line 1): should have at most 2 items, given a list of 3",
    ),
    task("limits: {position: [[1, 0], [0, 1], [0, 1], [0, 1], [0, 1]]}\n", "joint q1: lower position limit 1 must be"),
    task(
        "limits: {velocity: 0}\n",
        "limits.velocity (line 1): must be a number from 1e-09 to 1000000 rad/s or m/s, given 0",
    ),
    task("joints: [9]\n", "no joint named '9'; available: 1 (q1)"),
    task("joints: []\n", "no joint moves; choose from q1, q2, q3"),
    task("joints: [1.5]\n", "task.yaml: joints[1] (line 1): should be a valid string, given 1.5"),
    task("solver: magic\n", "no solver named 'magic'; available: sqp, ipopt"),
    task("noise: -1\n", "noise (line 1): must be a number from 1e-12 to 1e+12, given -1"),
    task("friction: perhaps\n", "no drive named 'perhaps'", "1 (z1)"),
)
ROBOTS = (
    plain("design nope --out out", "no robot 'nope': built-in robots are ", "a file of that name does not exist"),
    Case(
        ("design", ".", "--out", "out"), ("'.': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv",)
    ),
    file("arm.txt", "", "", "'arm.txt': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv"),
    file("bad.yaml", "name: x\njoints:\n  - name: a\n   mdh: {}\n", "", "bad.yaml, line 4: not valid YAML"),
    file(
        "bad.yaml",
        "name: x\njoints:\n  - name: a\n    mdh: {alhpa: 1}\n",
        "",
        "bad.yaml: joints[1].mdh.alhpa (line 4): ",
        "available: alpha, a, d, offset",
    ),
    file(
        "bad.yaml",
        ONE.format(limits="position: [1, -1]", more=""),
        "",
        "bad.yaml: joints[1].limits.position (line 2): lower bound 1 must be below the upper bound -1",
    ),
    file(
        "bad.yaml",
        ONE.format(limits="velocity: 0", more=""),
        "",
        "bad.yaml: joints[1].limits.velocity (line 2): should be greater than 0, given 0",
    ),
    file(
        "bad.yaml",
        ONE.format(limits="velocity: .nan", more=""),
        "",
        "bad.yaml: joints[1].limits.velocity (line 2): should be ",
    ),
    file(
        "bad.urdf",
        '<robot name="a">\n<link name="b">\n</robot>',
        "",
        "bad.urdf, line 3: not well-formed XML: mismatched tag",
    ),
    file("bad.urdf", BOMB, "", "bad.urdf, line 2: a DOCTYPE or ENTITY declaration is refused"),
    file("bad.urdf", "", "", "bad.urdf, line 1: not well-formed XML: no element found"),
    file("bad.urdf", "name: yaml\n", "", "bad.urdf, line 1: not well-formed XML"),
    file(
        "arm.urdf",
        ARM,
        "",
        "arm.urdf: 2 moving chains start from link 'base'; choose the last link with --tip",
        "left, right",
    ),
    file("arm.urdf", ARM, "--tip hand", "no link in arm.urdf named 'hand'; available: base, upper, left, right"),
    file(
        "arm.urdf",
        ARM,
        "--base world --tip left",
        "no link in arm.urdf named 'world'; available: base, upper, left, right",
    ),
    file("arm.urdf", ARM, "--base left --tip right", "arm.urdf: link 'right' does not hang below link 'left'"),
    file("arm.urdf", ARM, "--base base --tip base", "arm.urdf: no moving joint between the links 'base' and 'base'"),
    file(
        "arm.urdf",
        ARM,
        "--tip left",
        "arm.urdf, joint 'shoulder': no position limits are stated (the same for l); write <limit lower=",
        'or type="continuous" if it turns without end, or give --position-limit',
    ),
    file(
        "arm.urdf",
        ARM,
        "--tip left --position-limit=-1:1,-1:1",
        "no velocity or acceleration limit bounds joint shoulder, l; give --velocity-limit",
    ),
    file("arm.urdf", ARM, "--tip lefft", "no link in arm.urdf named 'lefft'; did you mean 'left'? available: base"),
    file(
        "arm.urdf.xacro",
        ARM.replace('"arm"', '"$(arg name)"'),
        "",
        "arm.urdf.xacro: the argument name has no value",
        "expand the file with one, and give the URDF: xacro arm.urdf.xacro name:=VALUE",
    ),
    file(
        "arm.urdf",
        ARM.replace('"arm"', '"${name}"'),
        "",
        "arm.urdf, line 1: <robot>: an expression of xacro: the text is a template, which is not expanded",
        "rename the file to arm.urdf.xacro, or give --xacro, if you trust whom it is from",
    ),
    file(
        "arm.urdf",
        ARM.replace('"arm"', '"${(lambda: 1)()}"'),
        "--xacro",
        "arm.urdf, line 1: a lambda is not allowed in an expression",
    ),
    file("arm.xml", "<mujoco/>", "", "arm.xml: no moving joint below link 'world'"),
    file("arm.sdf", "<sdf/>", "", "arm.sdf: SDF is not read, expected URDF, xacro or MJCF"),
    file(
        "arm.urdf",
        ARM.replace("</joint>", '<limits lower="-1" upper="1"/></joint>'),
        "--tip left",
        "joint 'shoulder': <joint> has no <limits>; did you mean <limit>? Correct it, or remove it",
    ),
)
DESIGNS = (
    file(
        "one.yaml",
        ONE.format(limits="position: [-1, 1]", more=""),
        "",
        "no velocity or acceleration limit bounds joint a; give --velocity-limit and --acceleration-limit",
    ),
    file(
        "irp6.yaml",
        IRP6.replace("position: [-0.69813, 0.43633]", "position: [1.5, 1.6]"),
        "",
        "limits contradict each other: no pose has joint q2 position in [-0.6981, 0.6981] rad and ",
        "joint q3 position in [-0.6981, 0.6981] rad and drive z3 position in [1.5, 1.6] rad; ",
        "the smallest relaxation widens ",
        " by 0.10",
    ),
    file(
        "blind.yaml",
        ONE.format(limits=FULL, more="structure: {zero: [I1zz]}\n"),
        "--no-friction",
        "no parameter of the differential model is identifiable from motions of a",
    ),
)
CASES = (*COMMANDS, *OPTIONS, *TASKS, *ROBOTS, *DESIGNS)
# A model all of whose columns are known to be zero.
BARE = file(
    "blind.yaml",
    ONE.format(
        limits=FULL,
        more="structure: {zero: [m1, m1c1x, m1c1y, m1c1z, I1xx, I1xy, I1xz, I1yy, I1yz, I1zz]}\n",
    ),
    "--no-friction",
    "no parameter of the differential model is identifiable from motions of a",
)


def refused(case: Case, ended: subprocess.CompletedProcess[str], folder: Path) -> None:
    assert ended.returncode == 2, ended.stderr
    assert ended.stdout == ""
    (line,) = ended.stderr.splitlines()
    assert line.startswith("excite: ")
    place = 0
    for part in case.message:
        place = line.find(part, place)
        assert place >= 0, f"{part!r} is not (in this place) in {line!r}"
        place += len(part)
    assert files_below(folder) == set(case.files)


@pytest.mark.parametrize("case", [*CASES, BARE], ids=str)
def test_refused_in_one_line(case: Case, here: Here) -> None:
    for name, text in case.files.items():
        (here.cwd / name).write_text(text, encoding="utf-8")
    refused(case, here.run(*case.arguments), here.cwd)


@pytest.mark.parametrize("case", [COMMANDS[1], OPTIONS[0], TASKS[2], ROBOTS[9], DESIGNS[1]], ids=str)
def test_refused_in_one_line_by_a_process_of_its_own(case: Case, tmp_path: Path) -> None:
    for name, text in case.files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    refused(case, run(*case.arguments, cwd=tmp_path, command=SCRIPT), tmp_path)


def test_unknown_robot_tells_all_that_are_built_in(here: Here) -> None:
    assert ", ".join(built_in_names()) in here.run("design", "nope", "--out", "out").stderr


def test_too_few_harmonics_for_the_parameters(here: Here) -> None:
    # Four sliders with a drive on each one and on each sum of two: the symmetric 4 x 4 inertia matrix and the weights
    # are seen through the accelerations alone, and 2 harmonics at rest have 2 independent ones.
    pairs = [{j, k} for j in range(4) for k in range(j + 1)]
    limits = "{position: [-1, 1], velocity: 1, acceleration: 1}"
    joints = "".join(f"  - {{name: s{k}, kind: prismatic, pose: {{}}, limits: {limits}}}\n" for k in range(4))
    drives = "".join(f"  - {{name: z{k}, rotor_inertia: 1.0}}\n" for k in range(len(pairs)))
    coupling = [[int(k in pair) for k in range(4)] for pair in pairs]
    text = f"name: gantry\njoints:\n{joints}drives:\n{drives}coupling: {coupling}\n"
    (here.cwd / "gantry.yaml").write_text(text)
    ended = here.run("design", "gantry.yaml", "--no-friction", "--harmonics", "2", "--out", "out")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(
        "excite: harmonics: fourier motions of 2 harmonics identify 11 of 14 parameters, but not "
    )
    assert ended.stderr.endswith("; 3 harmonics are enough\n")
    assert files_below(here.cwd) == {"gantry.yaml"}
    made = formulate(load_robot(str(here.cwd / "gantry.yaml")), Task("", friction=False, harmonics=3))
    assert made.target.base.rank == 14


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("file", "cannot write to file: it is a file, not a folder"),
        ("file/below", "cannot write to file/below: Not a directory"),
        ("/proc/excite", "cannot write to /proc/excite: "),
        ("/proc/self/fd/excite", "cannot write to /proc/self/fd/excite: "),
        ("starts-in-the-way", "cannot write starts-in-the-way/starts: File exists"),
        ("o" * 300, f"cannot write to {'o' * 300}: File name too long"),
    ],
)
def test_folder_that_cannot_be_written(out: str, message: str, here: Here) -> None:
    (here.cwd / "file").write_text("mine")
    (here.cwd / "starts-in-the-way").mkdir()
    (here.cwd / "starts-in-the-way" / "starts").write_text("mine")
    before = files_below(here.cwd)
    ended = here.run("design", "irp6", "--starts", "1", "--out", out)
    assert (ended.returncode, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"excite: {message}")
    assert files_below(here.cwd) == before
    assert (here.cwd / "file").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_folder_without_permission(here: Here) -> None:
    (here.cwd / "closed").mkdir(mode=0o555)
    ended = here.run("design", "irp6", "--starts", "1", "--out", "closed")
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr == "excite: cannot write to closed: Permission denied\n"


def test_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    ended = subprocess.run(
        ["bash", "-c", '"$0" -m excite robots irp6 | head -n 1', sys.executable],
        cwd=tmp_path,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.stdout.startswith("irp6: ")
    assert [line for line in ended.stderr.splitlines() if not line.endswith(" ...")] == []  # steps of slow machines
