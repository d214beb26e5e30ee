"""Bad input: one clear line of what was given, expected and available; too much work; text of others is literal."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from commands import SCRIPT, Here, files_below, run, run_process
from designed import irp6

from excite.cli.summary import LiteralConsole
from excite.design.formulation import formulate
from excite.tasks.task import Task
from regressors import input_files
from regressors.errors import InputError, UnknownName
from regressors.readers.library import built_in, built_in_names, load_robot

# Bad input: one clear line that says what was given, what was expected and what there is; exit 2; nothing written.


ARM = """\
<robot name="arm">
  <link name="base"/><link name="upper"/><link name="left"/><link name="right"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/></joint>
  <joint name="l" type="revolute"><parent link="upper"/><child link="left"/></joint>
  <joint name="r" type="revolute"><parent link="upper"/><child link="right"/></joint>
</robot>
"""


@dataclass(frozen=True)
class Case:
    """A command, the files that it meets, and the parts of its one line on stderr, in order."""

    arguments: tuple[str, ...]
    message: tuple[str, ...]
    files: dict[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return " ".join(self.arguments)


TEXTS = {
    "ARM": ARM,
    "ARM-OF-ARGUMENTS": ARM.replace('"arm"', '"$(arg name)"'),
    "ARM-OF-EXPRESSIONS": ARM.replace('"arm"', '"${name}"'),
    "ARM-OF-LAMBDAS": ARM.replace('"arm"', '"${(lambda: 1)()}"'),
    "ARM-OF-LIMITS": ARM.replace("</joint>", '<limits lower="-1" upper="1"/></joint>'),
}

# what is typed => parts of the message, in order; lines that begin with a space go on
COMMANDS = r"""
desing irp6 --out out => no command named 'desing'; did you mean design? available: robots, design, ... report,
    compare, bound; see 'excite --help'
design => Missing argument 'ROBOT' ... (help)
design irp6 => Missing option '--out' ... (help)
robots nope => no robot 'nope': built-in robots are ... a file of that name does not exist
robots irp6 --joints 9 => no joint named '9'; available: 1 (q1), 2 (q2), 3 (q3), 4 (q4), 5 (q5)
robots irp6 --tip tool0 => --base and --tip choose a part of a URDF, xacro or MJCF file, but 'irp6' is none
plan irp6 --at-once 0 => '--at-once': must be a whole number from 1 to 1000, given 0
plan panda --no-friction --at-once 1 => motions of at most 1 drive(s) at a time do not identify all 43 parameters
plan irp6 --after r => --after is for the next motion ... give --precision too ... see 'excite plan --help'
plan irp6 --precision 5% --after nowhere => --after: nowhere holds neither result.json nor design.json
plan irp6 --of measured => --of is for the next motion towards a precision
plan irp6 --precision 5% --of hoped => '--of': 'hoped' is not one of
design irp6 --after , --out out => '--after': expected names
compare nothing => nothing holds no design: there is no nothing/design.json
payload gain ur10e => did you mean gains?
design irp6 --stars 3 --out o => Did you mean one of:
design . --out out => '.': a robot's file ends in .yaml, .yml, .urdf, .xml, .xacro, .mjcf, .csv
design irp6 --task none.yaml --out out => cannot read task file none.yaml: No such file or directory
design irp6 --task . --out out => cannot read task file .: Is a directory
"""

OPTIONS = r"""
--joints 1,,3 => '--joints': expected names or numbers separated by commas, such as 1,3; given '1,,3' ... (help)
--velocity-limit 0 => '--velocity-limit': must be a number from 1e-09 to 1000000 rad/s or m/s, given 0
--velocity-limit nan => '--velocity-limit': expected finite numbers, given 'nan' ... (help)
--velocity-limit fast => '--velocity-limit': ... expected numbers separated by commas, such as 2.5,2,2, given ...
    (help)
--velocity-limit 1,2 => limits: velocity needs one value, or 5 for the joints q1, q2, q3, q4, q5; given 2
--position-limit 0:1 => limits: position needs 5 pairs, one per joint, given 1
--position-limit 0:1,0:nan => expected LOWER:UPPER per joint, such as -1:1,-2:0.5; given '0:1,0:nan' ... (help)
--harmonics 1 => harmonics: 1 are too few for a motion at rest at both ends; expected 2 or more
--harmonics 2.5 => '--harmonics': expected auto or a whole number, given '2.5' ... (help)
--harmonics 500 => 10 s at 100 Hz is 1000 samples, too few for 500 harmonics; expected a rate above 100 Hz
--period 9.999 => 9.999 s at 100 Hz is 999.9 samples, not a whole number; the nearest period is 10 s
--noise 1,2 => noise needs one value, or 3 for ... q1, q2, q3; given 2
--solver magic => '--solver': 'magic' is not one of sqp, nor module:Name of your own ... (help)
--executor cloud => 'cloud' is not one of process, serial, dask://HOST:PORT, dask-file:PATH, dask-loc ... (help)
--xacro => --xacro expands a file that ends in .urdf, .xml, .xacro, .mjcf, but 'irp6' is none of them
--base piovted => --base 'piovted': expected one of gautier, pivoted, orthonormal, or the base link of a URDF
--drives 1 --joints 1 => --joints and --drives exclude each other; give one of them
--drives 2 --require X1 => X1 is not identifiable from motions of z2; move z1, which identifies it
--model energy --window-length 20 => a window of 20 s is longer than the motion of 10 s
--require X9 => no parameter named 'X9'; available: X1, X2
--model load --sensor hand => named 'hand'; available: 1 (column), 2 (arm)
--model load --sensor-xyz 1,2 => '--sensor-xyz': expected three numbers separated by commas, given '1,2' ... (help)
--model load --equations fq => no equation named 'fq'; available: fx, fy, fz, nx, ny, nz
--start lying => no start named 'lying'; available: random, cosine, quintic, sines
--base gautier --base pivoted => --base names more than one convention: gautier, pivoted ... (help)
"""

TASKS = r"""
harmonics: 3\nperod: 3\n => task.yaml: perod (line 2): no such field; did you mean period? available: robot, ... more
limits:\n  speed: 3\n => limits.speed (line 2): no such field; available: position, velocity, acceleration
harmonics: 3\n harmonics: 4\n => task.yaml, line 2: not valid YAML
harmonics: 3\nharmonics: 4\n => task.yaml: harmonics (line 1): is given twice, again in line 2
 => task.yaml: expected a mapping of fields, given nothing
limits: {velocity: .inf}\n => task.yaml: limits.velocity (line 1): must be a number from 1e-09 to 1000000 ... given inf
limits: {position: [[0, 1, 2]]}\n => limits.position (line 1): should be a list of pairs [lower, upper], given [[0
joints: []\n => no joint moves; choose from q1, q2, q3
friction: perhaps\n => no drive named 'perhaps' ... 1 (z1)
"""

FILES = r"""
bad.yaml | name: x\njoints:\n  - name: a\n    mdh: {alhpa: 1}\n |  => bad.yaml: joints[1].mdh.alhpa (line 4): ...
    available: alpha, a, d, offset
bad.yaml | name: one\njoints: [{name: a, mdh: {}, limits: {velocity: 0}}]\n |  => bad.yaml: joints[1].limits.velocity
    (line 2): should be greater than 0, given 0
bad.urdf | <robot name="a">\n<link name="b">\n</robot> |  => bad.urdf, line 3: not well-formed XML: mismatched tag
arm.urdf | ARM |  => arm.urdf, joint 'shoulder': no position limits are stated (the same for l, r); write <limit
arm.urdf | ARM | --base base --tip base => arm.urdf: no moving joint between the links 'base' and 'base'
arm.urdf | ARM | --tip left => arm.urdf, joint 'shoulder': no position limits are stated (the same for l); write
    <limit lower= ... or type="continuous" if it turns without end, or give --position-limit
arm.urdf | ARM | --tip left --position-limit=-1:1,-1:1 => no velocity or acceleration limit bounds joint shoulder, l;
    give --velocity-limit
arm.urdf | ARM | --base left --tip right => arm.urdf: link 'right' does not hang below link 'left'
arm.urdf.xacro | ARM-OF-ARGUMENTS |  => arm.urdf.xacro: the argument name has no value ... expand the file with one,
    and give the URDF: xacro arm.urdf.xacro name:=VALUE
arm.urdf | ARM-OF-EXPRESSIONS |  => arm.urdf, line 1: <robot>: an expression of xacro: the text is a template, which
    is not expanded ... rename the file to arm.urdf.xacro, or give --xacro, if you trust whom it is from
arm.urdf | ARM-OF-LAMBDAS | --xacro => arm.urdf, line 1: a lambda is not allowed in an expression
arm.urdf | ARM-OF-LIMITS | --tip left => joint 'shoulder': <joint> has no <limits>; did you mean <limit>? Correct it,
    or remove it
one.yaml | name: one\njoints: [{name: a, mdh: {}, limits: {position: [-1, 1]}}]\n |  => no velocity or acceleration
    limit bounds joint a; give --velocity-limit and --acceleration-limit
blind.yaml | name: one\njoints: [{name: a, mdh: {}, limits: {position: [-1, 1], velocity: 1, acceleration:
    1}}]\nstructure: {zero: [I1zz]}\n | --no-friction => no parameter of the differential model is identifiable from
    motions of a
blind.yaml | name: one\njoints: [{name: a, mdh: {}, limits: {position: [-1, 1], velocity: 1, acceleration:
    1}}]\nstructure: {zero: [m1, m1c1x, m1c1y, m1c1z, I1xx, I1xy, I1xz, I1yy, I1yz, I1zz]}\n | --no-friction => no
    parameter of the differential model is identifiable from motions of a
"""


def rows(table: str) -> Iterator[tuple[str, tuple[str, ...]]]:
    """What is typed, and the parts of its message."""
    for line in re.sub(r"\n {4}", " ", table.strip("\n")).splitlines():
        typed, _, message = line.partition(" => ")
        yield typed, tuple(message.replace("(help)", "see 'excite design --help'").split(" ... "))


def of_a_file(row: str, message: tuple[str, ...]) -> Case:
    """Case of a row NAME | TEXT | OPTIONS."""
    name, text, options = (part.strip() for part in row.split("|"))
    files = {name: TEXTS.get(text, text.replace(r"\n", "\n"))}
    return Case(("design", name, *options.split(), "--out", "out"), message, files)


TASK = ("design", "irp6", "--task", "task.yaml", "--out", "out")
CASES = (
    *(Case(tuple(typed.split()), message) for typed, message in rows(COMMANDS)),
    *(Case(("design", "irp6", *typed.split(), "--out", "out"), message) for typed, message in rows(OPTIONS)),
    *(Case(TASK, message, {"task.yaml": text.replace(r"\n", "\n")}) for text, message in rows(TASKS)),
    *(of_a_file(row, message) for row, message in rows(FILES)),
    Case(("design", "irp6", "--out", ""), ("'--out': expected the name of a folder, given ''",)),
    Case(("design", "irp6", "--task", "two\nlines", "--out", "o"), ("cannot read task file two lines: No such file",)),
    Case(("design", "./amr.urdf", "--out", "o"), ("did you mean 'arm.urdf'?",), {"arm.urdf": "<robot/>"}),
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


@pytest.mark.parametrize("case", CASES, ids=str)
def test_refused_in_one_line(case: Case, here: Here) -> None:
    for name, text in case.files.items():
        (here.cwd / name).write_text(text, encoding="utf-8")
    refused(case, here.run(*case.arguments), here.cwd)


def test_refused_in_one_line_by_a_process_of_its_own(tmp_path: Path) -> None:
    refused(CASES[1], run(*CASES[1].arguments, cwd=tmp_path, command=SCRIPT), tmp_path)


def test_a_name_that_is_like_none_tells_all_that_are_built_in() -> None:
    for load, kind in ((load_robot, InputError), (built_in, UnknownName)):
        with pytest.raises(kind) as raised:
            load("spot")
        assert "did you mean" not in str(raised.value)
        assert ", ".join(built_in_names()) in str(raised.value)


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
    said = here.refused("design", "gantry.yaml", "--no-friction", "--harmonics", "2", "--out", "out")
    assert said.startswith("excite: harmonics: fourier motions of 2 harmonics identify 11 of 14 parameters, but not ")
    assert said.endswith("; 3 harmonics are enough\n")
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
    said = here.refused("design", "irp6", "--starts", "1", "--out", out)
    assert said.startswith(f"excite: {message}")
    assert (here.cwd / "file").read_text() == "mine"


def test_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    ended = run_process(["bash", "-c", '"$0" -m excite robots irp6 | head -n 1', sys.executable], tmp_path)
    assert ended.stdout.startswith("irp6: ")
    assert [line for line in ended.stderr.splitlines() if not line.endswith(" ...")] == []  # steps of slow machines


# Bounds of the commands: too much work is refused at once, what is no file too; text of others is literal.


ESCAPE = "\x1b[31m"
LARGE = {
    "design irp6 --harmonics 1000 --rate 1000 --workers 2 --out out": "--harmonics",
    "design irp6 --trajectory bspline --intervals 900 --workers 2 --out out": "--intervals",
    "design irp6 --home 0,0,0,0,0 --settle 1e5 --rate 1e4 --out out": "--settle",
    "design irp6 --model energy --window-length 1e-6 --out out": "--window-length",
    "simulate irp6 --rate 1e7 --out run.csv": "--rate",
    "simulate irp6 --periods 100000 --out run.csv": "--periods",
    "friction plan irp6 --warm-up 1e5 --out out": "--warm-up",
    "friction plan irp6 --repeats 100000 --out out": "--repeats",
    "study irp6 --design irp6 --points 1000000 --repeats 1000000 --out out": "--points",
}


def test_too_much_work_is_refused_at_once(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    (here.cwd / "irp6").symlink_to(irp6().folder)
    for command, option in LARGE.items():
        line = here.refused(*command.split())
        assert re.search(rf"{option}\b", line)
        assert "more than the cap of 4 GB" in line
        assert line.endswith(", or raise the cap with EXCITE_MEMORY_CAP [GB]\n")
    monkeypatch.setenv("EXCITE_MEMORY_CAP", "0.001")
    assert "more than the cap of 1 MB" in here.refused("design", "irp6", "--out", "out")


READING = (
    "design irp6 --task {} --out out",
    "design irp6 --world {} --out out",
    "design irp6 --friction-curves {} --out out",
    "design irp6 --prior {} --out out",
    "identify irp6 {} --out out",
    "identify irp6 run.csv --mapping {} --out out",
    "friction plan irp6 --world {} --out out",
)


def test_commands_refuse_devices_and_silent_pipes(here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(input_files, "SILENCE", 0.05)
    os.mkfifo(here.cwd / "pipe")
    for command in READING:
        for file, why in (("/dev/zero", "it is a device"), ("pipe", "nothing came through it")):
            assert why in here.run(*command.format(file).split(), status=2).stderr.splitlines()[-1]
            assert not (here.cwd / "out" / "design.json").exists()


BAD_TEXT = (
    "time,a.position\n0,0\n1," + 5000 * "z" + "\n",
    f"time,a.position\n0,0\n1,{ESCAPE}\n",
    f"time,{ESCAPE}.position\n0,0\n1,0\n",
    "time," + ",".join(f"{k}{100 * 'n'}.position" for k in range(900)) + "\n",
)


@pytest.mark.parametrize("name", ["log.csv", f"{ESCAPE}log.csv"])
def test_errors_echo_the_text_of_files_cut_and_literally(here: Here, name: str) -> None:
    for text in BAD_TEXT:
        (here.cwd / name).write_text(text)
        ended = here.run("identify", "irp6", name, "--out", "out", status=2)
        for line in ended.stderr.splitlines():  # progress too, where it takes long
            assert (line.isprintable(), len(line) <= 510) == (True, True)


def test_aliases_and_entities_are_not_expanded_and_nesting_is_bounded(here: Here) -> None:
    levels = "\n".join(f"a{k}: &a{k} [{', '.join(9 * [f'*a{k - 1}'])}]" for k in range(1, 12))
    (here.cwd / "bomb.yaml").write_text(f"a0: &a0 [x]\n{levels}\n")
    said = here.refused("design", "irp6", "--task", "bomb.yaml", "--out", "out")
    assert ("anchors and aliases" in said, len(said) <= 510) == (True, True)
    (here.cwd / "bomb.xml").write_text('<!DOCTYPE robot [<!ENTITY e "x">]><robot name="&e;"/>')
    assert "DOCTYPE" in here.refused("robots", "bomb.xml")
    open_links, closed = '<robot name="r">' + 30_000 * "<link>", 30_000 * "<a>" + 30_000 * "</a>"
    for text in (open_links, f'<robot name="r">{closed}</robot>', "\n".join(k * " " + "a:" for k in range(1500))):
        name = "deep.yaml" if text.startswith("a:") else "deep.urdf"
        (here.cwd / name).write_text(text)
        here.refused("robots", name)


def test_the_console_prints_names_literally(capsys: pytest.CaptureFixture[str]) -> None:
    LiteralConsole(markup=False, highlight=False, width=80).print(f"[red]{ESCAPE}a\x9bb\rc\nd", style="bold")
    shown = capsys.readouterr().out
    assert "[red]" in shown
    assert shown.replace("\n", "").isprintable()
    assert shown.splitlines()[1].strip() == "d"
