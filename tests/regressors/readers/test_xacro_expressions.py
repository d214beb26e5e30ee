"""The reader of xacro: hostile expressions are refused with their line, those of vendors have xacro's own values."""

from __future__ import annotations

import contextlib
import html
import io
import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from public_arms import robot_file
from refused import refusal
from written_files import text_file

from regressors.errors import InputError
from regressors.readers import urdf
from regressors.readers.library import load_robot
from regressors.readers.urdf import expand_xacro, parse_urdf, read_xacro
from regressors.readers.xacro_expressions import LARGEST, LONGEST, Refused, evaluate, known_names

xacro = pytest.importorskip("xacro", reason="xacro is not installed (pip install xacro)")

OPEN = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
LINE = 3  # of the expression

# An expression, and what the refusal says.
EXPRESSIONS = {
    "import": ("__import__('os').system('touch {canary}')", "the name '__import__' is not allowed"),
    "subclasses": ("().__class__.__base__.__subclasses__()", "the attribute '__subclasses__' is not allowed"),
    "builtins": ("__builtins__", "the name '__builtins__' is not allowed"),
    "comprehension": ("[c for c in (1).real.conjugate().__class__.__mro__]", "a comprehension is not allowed"),
    "walrus": ("(os := 1)", "an assignment is not allowed"),
    "star": ("max(*[1, 2])", "Starred, which is not allowed"),
    "two stars": ("dict(**dict(a=1))", r"'\*\*' before a dictionary is not allowed"),
    "open": ("open('{canary}', 'w')", "name 'open' is not defined"),
    "type": ("python.type('a', (), dict())", "name 'type' is not defined"),
    "call of a value": ("(1)(2)", "calling 1 is not allowed"),
    "mapped text": ("list(map('exec', ['1']))", "map of str is not allowed"),
    "key of a sort": ("sorted([1], key=max)", "'Function' object is not callable"),
    "huge power": ("9**9**9", "a whole number of more than 10000 binary digits"),
    "huge shift": ("1 << 10**9", "LShift, which is not allowed"),
    "huge list": ("[0]*10**10", r"a value repeated 1e\+10 times is too large"),
    "huge text": ("10**10*'a'", r"a value repeated 1e\+10 times is too large"),
    "huge range": ("len(list(range(10**9)))", r"a range of 1e\+09 numbers is too long"),
    "huge field": ("'%999999999d' % 1", "a format with such a width is not allowed"),
    "huge rounding": ("round(5, -10**9)", r"rounding to -1e\+09 digits is not allowed"),
    "huge factorial": ("math.factorial(10**7)", "math.factorial of a number above 1000 is not allowed"),
    "long": ("1+" * LONGEST + "1", "an expression of 20001 characters, more than the 10000"),
    "deep": ("(" * 900 + "1" + ")" * 900, "too many nested parentheses"),
}  # fmt: skip


@pytest.mark.parametrize(("expression", "message"), EXPRESSIONS.values(), ids=EXPRESSIONS)
def test_hostile_expressions_are_refused(expression: str, message: str) -> None:
    with pytest.raises((Refused, NameError, SyntaxError, TypeError), match=message):
        evaluate(expression, known_names({}))


# An expression as the value of a mass, and what the refusal says. {canary} is a file that none may write, {secret} one
# that none may read.
HOSTILE = {
    "issue": ("${(lambda f=xacro.load_yaml: f.__globals__['os'].system('touch {canary}'))()}", "a lambda is not allow"),
    "code of a function": ("${xacro.load_yaml.func_globals}", "the attribute 'func_globals' of a Function"),
    "f-string": ("hidden: f'{xacro.load_yaml.__globals__}'", "an f-string is not allowed"),
    "format": ("hidden: '{0.__globals__}'.format(load_yaml)", "the attribute 'format' of a str is not allowed"),
    "eval of arguments": ("hidden: __import__('os').system('touch {canary}')", "the name '__import__' is not allowed"),
    "environment": ("$(env HOME)", r"\$\(env HOME\): the environment is not visible to a description"),
    "YAML elsewhere": ("${xacro.load_yaml('{secret}')}", "is outside the folder of arm.xacro"),
    "YAML above": ("${xacro.load_yaml('../secret.yaml')}", "is outside the folder of arm.xacro"),
    "YAML through a link": ("${xacro.load_yaml('link.yaml')}", "is outside the folder of arm.xacro"),
    "YAML with a tag": ("${xacro.load_yaml('tag.yaml')}", "could not determine a constructor for the tag"),
    "YAML with a unit": ("${xacro.load_yaml('unit.yaml')}", "a lambda is not allowed"),
    "package of the system": ("$(find etc)/passwd", "no package.xml, and is no package"),
    "package above": ("$(find ../..)", r"\$\(find \.\./\.\.\): expected the name of a package"),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of a description, beside what none may touch."""
    inside = tmp_path / "arm"
    inside.mkdir()
    (tmp_path / "secret.yaml").write_text("password: 1", encoding="utf-8")
    (inside / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    (inside / "tag.yaml").write_text("!!python/object/apply:os.system [touch canary]", encoding="utf-8")
    (inside / "unit.yaml").write_text("a: !degrees '(lambda: 1)()'", encoding="utf-8")
    return inside


def document(folder: Path, body: str, name: str = "arm.xacro") -> Path:
    return text_file(folder / name, f"{OPEN}<!-- ${{1}} -->\n{body}\n</robot>")


def mass(expression: str) -> str:
    """A link whose mass is an expression; a hidden one has braces and comes to `eval` through a property."""
    if expression.startswith("hidden: "):
        hidden = html.escape(expression.removeprefix("hidden: "))
        return f'<xacro:property name="hidden" value="{hidden}"/>' + mass("$(eval ${hidden})")
    return f'<link name="a"><mass value="{html.escape(expression)}"/></link>'


@pytest.mark.parametrize(("expression", "message"), HOSTILE.values(), ids=HOSTILE)
def test_hostile_expressions_are_refused_with_their_line(
    expression: str, message: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    canary = folder.parent / "canary"
    filled = expression.replace("{canary}", str(canary)).replace("{secret}", str(folder.parent / "secret.yaml"))
    told = refusal(load_robot, str(document(folder, mass(filled))))
    assert re.search(message, told)
    assert re.search(rf"arm\.xacro, line {LINE}\b", told)
    assert sorted(each.name for each in folder.parent.rglob("canary")) == []


def slow(body: str, message: str) -> Any:
    return pytest.param(body, message, marks=pytest.mark.slow)


# Documents that never end, or take all memory, unless something ends them.
ENDLESS = {
    "macro of itself": (
        '<xacro:macro name="m" params="k">\n<xacro:m k="${k}"/></xacro:macro>\n<xacro:m k="1"/>',
        r"arm\.xacro: <xacro:m> is more than 400 deep within each other, and contains itself",
    ),
    "include of itself": ('<xacro:include filename="arm.xacro"/>', r"arm\.xacro: arm\.xacro is more than 400 deep wit"),
    "macros that double": slow(
        "".join(
            f'<xacro:macro name="m{k}"><xacro:m{k - 1}/><xacro:m{k - 1}/></xacro:macro>\n' for k in range(1, 40)
        ).replace("<xacro:m0/>", "<link/>") + "<xacro:m39/>",
        "goes beyond 20000 calls of macros",
    ),
    "properties that double": (
        '<xacro:property name="p0" value="aaaaaaaaaa"/>'
        + "".join(f'<xacro:property name="p{k}" value="${{p{k - 1}}}${{p{k - 1}}}"/>\n' for k in range(1, 40))
        + mass("${p39}"),
        "a text grows beyond 1000000 characters",
    ),
    "elements within each other": ("<a>" * 30_000 + "</a>" * 30_000, "too deep within each other|more than 150 MB"),
    "entities": ("", r"arm\.xacro, line 1: a DOCTYPE or ENTITY declaration is refused"),
    "lists of lists": slow(mass("${str(xacro.load_yaml('laughs.yaml'))}"), "takes more (memory|than)|too large"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "message"), ENDLESS.values(), ids=ENDLESS)
def test_endless_documents_end(body: str, message: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(urdf, "CPU", 60)
    monkeypatch.setattr(urdf, "MEMORY", 150 * 10**6)
    laughs = ["a0: &a0 [1, 2, 3, 4, 5, 6, 7, 8, 9]"]
    laughs += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)]
    (folder / "laughs.yaml").write_text("\n".join(laughs), encoding="utf-8")
    path = document(folder, body)
    if not body:
        path.write_text("<!DOCTYPE a [<!ENTITY b 'c'>]>" + path.read_text(), "utf-16")
    assert re.search(message, refusal(expand_xacro, path))


@pytest.mark.parametrize(
    ("cap", "value", "message"),
    [("CPU", 1, "takes more than 1 s of computing, the most"), ("WALL", 0.01, "takes more than 0.01 s, the most")],
)
def test_caps_end_what_takes_too_long(
    cap: str, value: float, message: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(urdf, cap, value)
    slow = mass("${" + " + ".join(["math.prod(range(1, 90000))"] * 9) + "}")
    assert re.search(message, refusal(expand_xacro, document(folder, slow)))


def test_a_module_beside_the_file_is_not_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    for module in ("xacro", "yaml", "json", "regressors"):
        (folder / f"{module}.py").write_text(f"open({str(folder / 'canary')!r}, 'w')", encoding="utf-8")
    assert "<link" in expand_xacro(document(folder, mass("${1}")).name)
    assert not (folder / "canary").exists()


def test_includes_are_read_as_carefully(folder: Path) -> None:
    (folder.parent / "part.xacro").write_text(f"{OPEN}</robot>", encoding="utf-8")
    with pytest.raises(InputError, match=r"part\.xacro is outside the folder of arm\.xacro"):
        expand_xacro(document(folder, '<xacro:include filename="../part.xacro"/>'))
    (folder / "part.xacro").write_text(f"{OPEN}\n{mass('${lambda: 1}')}</robot>", encoding="utf-8")
    with pytest.raises(InputError, match=r"^arm\.xacro: part\.xacro, line 3: a lambda"):
        expand_xacro(document(folder, '<xacro:include filename="part.xacro"/>'))
    (folder.parent / "package.xml").write_text("<package/>", encoding="utf-8")
    (folder.parent / "part.xacro").write_text(f"{OPEN}<link name='p'/></robot>", encoding="utf-8")
    assert 'name="p"' in expand_xacro(document(folder, '<xacro:include filename="../part.xacro"/>'))


@pytest.mark.parametrize("name", ["arm.urdf", "arm.xml", "arm.mjcf"])
def test_content_alone_expands_nothing(name: str, folder: Path) -> None:
    canary = folder / "canary"
    text = HOSTILE["issue"][0].replace("{canary}", str(canary))
    path = document(folder, mass(text), name)
    with pytest.raises(InputError, match=rf"{name}, line {LINE}: .* an expression of xacro: .* or give `xacro=True`"):
        load_robot(str(path))
    assert re.search(rf"{name}, line {LINE}: a lambda is not allowed", refusal(load_robot, str(path), xacro=True))
    assert not canary.exists()


# What vendors' descriptions hold: UR, Franka, xArm, Kinova, KUKA's community and many mobile robots.
VENDORS = {
    "arithmetic": "${0.0833333 * 2 * (3 * 0.1**2 + 0.5 * 0.5)} ${7 // 2} ${7 % 3} ${-pi/2} ${+1} ${2 - 1.5e-3}",
    "mathematics": "${sin(pi/3)} ${math.cos(0.1)} ${radians(30)} ${math.degrees(1)} ${sqrt(2)} ${atan2(1, 2)} ${tau}",
    "comparisons": "${1 < 2 <= 2} ${1 == 1.0} ${'a' != 'b'} ${'left' in 'left_arm'} ${3 not in [1, 2]} ${None is None}",
    "conditions": "${'' if False else 'arm' + '_'} ${True and 0 or 'x'} ${not 1} ${pi/2.0 if 'y' in 'xyz' else 0}",
    "dictionaries": "${dict(shoulder=0.0, elbow=-1.57)} ${dict(a=dict(b=1))['a']['b']} ${'a' in dict(a=1)}",
    "lists": "${[1, 2, 3][1]} ${[1, 2, 3][-1]} ${[1, 2, 3][0:2]} ${len([1, 2])} ${[0] * 3} ${(1, 2) + (3,)}",
    "functions": "${max(1, 2)} ${min([3, 1])} ${round(1.23456, 2)}"
    " ${int('7')} ${float('1e3')} ${str(2) + 'a'} ${bool(0)}",
    "python": "${python.abs(-1)} ${python.sum([1, 2])} ${python.sorted([2, 1])}"
    " ${python.any([0, 1])} ${list(map(int, '123'))}",
    "texts": "${'0 0 0.1'.split(' ')[2]} ${'Arm'.lower()}"
    " ${'a-b'.replace('-', '_')} ${'_'.join(['a', 'b'])} ${'%.3f' % pi}",
    "YAML": "${cfg['limits']['j1']} ${cfg.limits.j1.lower} ${cfg.origin.xyz}"
    " ${cfg.angle} ${cfg.list[1].name} ${cfg.limits.get('j9', 5)}",
    "YAML, direct": "${xacro.load_yaml('cfg.yaml').limits.j1.upper} ${load_yaml('cfg.yaml')['origin']['rpy']}",
    "xacro": "${xacro.arg('speed')} ${xacro.tokenize('1 2;3')}"
    " ${xacro.dotify(dict(a=1)).a} ${xacro.warning('careful')}",
    "arguments": "$(arg speed) ${2 * $(arg speed)} $(eval 2 * speed) $(eval speed + 1.5) $(eval 'a' if on else 'b')",
    "environment": "$(optenv NO_SUCH_VARIABLE_HERE 3)",
    "escapes": "$${a} $$(b) $ 5$",
    "names": "${_own} ${prefix}link ${e}",
}  # fmt: skip


DEFINED = """<xacro:arg name="speed" default="3"/><xacro:arg name="on" default="true"/>
<xacro:property name="cfg" value="${xacro.load_yaml('cfg.yaml')}"/>
<xacro:property name="_own" value="7"/><xacro:property name="prefix" value="left_"/>
<xacro:property name="e" value="mine"/>
"""
CFG = """limits: {j1: {lower: -1.5, upper: 2}}
origin: {xyz: 0 0 0.1, rpy: 0 0 0}
angle: !degrees 90
list: [1, {name: second}]
"""


def by_xacro(path: Path) -> str:
    """The oracle: xacro itself."""
    with contextlib.redirect_stderr(io.StringIO()):
        return str(xacro.process_file(str(path), mappings={}).toprettyxml(indent="  "))


def body_of(text: str) -> str:
    return re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)


def test_what_vendors_write_has_the_value_that_xacro_gives(folder: Path) -> None:
    (folder / "cfg.yaml").write_text(CFG, encoding="utf-8")
    links = "".join(f'<link name="{html.escape(text)}"/>' for text in VENDORS.values())
    path = document(folder, DEFINED + links)
    assert body_of(expand_xacro(path)) == body_of(by_xacro(path))


# Structure: macros with blocks and defaults, namespaces, conditions, dynamic calls, a loop by recursion.
STRUCTURE = """
<xacro:property name="inner"><origin xyz="0 0 ${1 + 1}"/></xacro:property>
<xacro:macro name="loop" params="k *block **more x:=^|5 y:='0 0'">
  <link name="l${k}" x="${x}" y="${y}"><xacro:insert_block name="block"/><xacro:insert_block name="more"/></link>
  <xacro:if value="${k > 0}"><xacro:loop k="${k - 1}" y="${y.split()[0]} 1"><a/><b><c/></b></xacro:loop></xacro:if>
</xacro:macro>
<xacro:include filename="part.xacro" ns="part"/>
<xacro:include filename="not-there.xacro" optional="true"/>
<xacro:loop k="3"><o/><p><q v="${part.size}"/></p></xacro:loop>
<xacro:part.box side="${part.size * 2}"/>
<xacro:property name="which" value="loop"/>
<xacro:call macro="${which}" k="0"><a/><b/></xacro:call>
<xacro:element xacro:name="l${'ink'}" name="z"><xacro:attribute name="w" value="w${1 / 3}"/></xacro:element>
<xacro:unless value="${1 == 2}"><xacro:insert_block name="inner"/></xacro:unless>
"""
PART = f"""{OPEN}<xacro:property name="size" value="0.5"/>
<xacro:macro name="box" params="side"><box size="${{side}} ${{size}}"/></xacro:macro></robot>"""


def test_structure_is_expanded_as_xacro_expands_it(folder: Path) -> None:
    (folder / "part.xacro").write_text(PART, encoding="utf-8")
    path = document(folder, STRUCTURE)
    assert body_of(expand_xacro(path)) == body_of(by_xacro(path))


def test_a_vendors_file_is_expanded_as_xacro_expands_it() -> None:
    path = robot_file("hector_description/robots/quadrotor_base.urdf.xacro")
    assert body_of(expand_xacro(path)) == body_of(by_xacro(path))


def test_a_value_has_no_attributes() -> None:
    class Own:
        secret = 1

    for name, value in {"a": Own(), "b": socket, "c": {"secret": 1}, "d": Own}.items():
        with pytest.raises(Refused, match="the attribute 'secret' of a"):
            evaluate(f"{name}.secret", {name: value})
        with pytest.raises(Refused, match=r"calling .* is not allowed"):
            evaluate(f"{name}()", {name: value})


def test_values_are_bounded() -> None:
    names: dict[str, Any] = {**known_names({}), "a": "a" * LARGEST}
    for text in ("a + a", "a.replace('a', 'bb')", "list(a) + [1]", "a.join([a, a])", "2**9999 * 2**9999"):
        with pytest.raises(Refused, match="too large"):
            evaluate(text, names)


def test_the_process_that_expands_is_closed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever gets past the expressions: an expression function that is hostile itself cannot reach the system."""
    hostile: dict[str, str] = {
        "a socket": "__import__('socket').socket()",
        "a process": "__import__('os').system('true')",
        "a fork": "__import__('os').fork()",
        "writing": f"open({str(folder / 'canary')!r}, 'w')",
        "reading": f"open({str(folder.parent / 'secret.yaml')!r})",
        "importing": "__import__('ftplib')",
        "removing": f"__import__('os').remove({str(folder / 'tag.yaml')!r})",
        "code": "eval('1 + 1')",
    }
    code = """
import json, sys
from pathlib import Path
from regressors.readers import xacro_expansion as process
process._close(process._Files(Path(sys.argv[1])))
outcome = {}
calls = {"a socket": lambda: __import__("_socket").socket(), **{CALLS}}
for name, call in calls.items():
    try:
        call()
        outcome[name] = "done"
    except process.Refused as error:
        outcome[name] = str(error)
sys.stdout.write(json.dumps(outcome))
sys.stdout.flush()
import os; os._exit(0)
"""
    calls = "{" + ", ".join(f"{name!r}: lambda: {text}" for name, text in hostile.items()) + "}"
    command = [sys.executable, "-c", code.replace("{CALLS}", calls), str(folder / "arm.xacro")]
    outcome = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    assert list(outcome) == list(hostile)
    assert [said for said in outcome.values() if "is not allowed while" not in said] == []


NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
PART_OF_ARM = """
    <link name="l${k}">
      <inertial><mass value="${mass}"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    </link>
    <joint name="j${k}" type="revolute">
      <parent link="${parent}"/><child link="l${k}"/><origin xyz="0 0 0.3" rpy="${pi / 2} 0 0"/>
      <limit lower="-1" upper="1" effort="2" velocity="$(arg speed)"/>
    </joint>"""
ARM_PART = f'<robot {NAMESPACE}><xacro:macro name="part" params="k parent mass">{PART_OF_ARM}</xacro:macro></robot>'
ARM = f"""
<robot name="arm" {NAMESPACE}>
  <xacro:arg name="speed" default="3"/>
  <xacro:include filename="$(find some_arm)/urdf/part.xacro"/>
  <link name="base"/>
  <xacro:part k="1" parent="base" mass="2"/>
  <xacro:part k="2" parent="l1" mass="${{2 * 0.25}}"/>
</robot>
"""


def expanded(**values: str) -> str:
    """The part of the arm, by hand."""
    text = PART_OF_ARM.replace("${pi / 2}", repr(np.pi / 2)).replace("$(arg speed)", "3")
    return re.sub(r"\$\{(\w+)\}", lambda found: values[found[1]], text)


PARTS = expanded(k="1", parent="base", mass="2") + expanded(k="2", parent="l1", mass="0.5")
EXPANDED = f'<robot name="arm"><link name="base"/>{PARTS}</robot>'


def package(root: Path, text: str = ARM, name: str = "arm.urdf.xacro") -> str:
    """A package some_arm with a file that describes an arm."""
    folder = root / "some_arm" / "urdf"
    folder.mkdir(parents=True)
    (folder / "part.xacro").write_text(ARM_PART, encoding="utf-8")
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.xacro", "arm.urdf", "arm.xml"])
def test_robot_is_that_of_the_expanded_text(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    robot = load_robot(package(tmp_path, name=name), tip="l2", xacro=not name.endswith(".xacro"))
    assert robot.sha256() == parse_urdf(EXPANDED).sha256()
    assert robot.source == f"URDF {name}"
    assert capfd.readouterr() == ("", "")


def test_arguments(tmp_path: Path) -> None:
    assert read_xacro(package(tmp_path), arguments={"speed": "4"}).limits.velocity.tolist() == [4, 4]


@pytest.mark.parametrize(
    ("how", "inside"),
    [
        *(("ROS_PACKAGE_PATH", inside) for inside in ("", "some_arm", "ros/some_arm")),
        ("AMENT_PREFIX_PATH", "prefix/share/some_arm"),
    ],
)
def test_packages_are_found(how: str, inside: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "workspace" / inside
    package(place.parent if inside else place)
    (tmp_path / "arm.xacro").write_text(ARM, encoding="utf-8")
    root = {"": place, "some_arm": place, "ros/some_arm": place.parents[1]}.get(inside, tmp_path / "workspace/prefix")
    monkeypatch.setenv(how, f"/nowhere:{root}")
    robot = read_xacro(tmp_path / "arm.xacro")
    assert robot.joint_names == ("j1", "j2")


BROKEN = {
    "missing package": (ARM.replace("some_arm", "other_arm"), "a.xacro: no folder of the package 'other_arm', neither"),
    "missing include": (ARM.replace("part.xacro", "parts.xacro"), "a.xacro: xacro does not expand it: No such file or"),
    "missing argument": (
        ARM.replace('<xacro:arg name="speed" default="3"/>', ""),
        "a.xacro: the argument speed has no value; expand the file with one, and give the URDF: "
        "xacro a.xacro speed:=VALUE > a.urdf",
    ),
    "unknown macro": (ARM.replace('<xacro:part k="1"', '<xacro:link k="1"'), "xacro does not expand it: unknown macro"),
    "no URDF": (ARM.replace('parent="l1"', 'parent="l7"'), "a.xacro, expanded, line "),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_broken_files_are_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    assert message in refusal(load_robot, package(tmp_path, text, "a.xacro"))


@pytest.mark.parametrize("package_name", ["xacro", "simpleeval"])
def test_missing_packages_are_told_with_their_extra(
    package_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"{package_name}.py").write_text("raise ImportError", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    assert "one is not installed; pip install 'excite-trajectories[xacro]'" in refusal(load_robot, package(tmp_path))
