"""The distribution: whose the packages are, and that README, lock, metadata and continuous integration agree."""

import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.markers import Marker, default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version
from ruamel.yaml import YAML

ROOT = Path(__file__).resolve().parents[1]
DISTRIBUTION = "excite-trajectories"
PACKAGES = ("excite", "regressors", "constraints")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DIRECT = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]
LOCK = (ROOT / "requirements.lock").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = re.findall(r"^```sh\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)[:2]


@pytest.mark.parametrize("package", PACKAGES)
def test_package_is_owned_by_this_distribution_alone_and_typed(package: str) -> None:
    # An editable install lists no files below its packages, so it may be missing from the owners.
    assert set(metadata.packages_distributions().get(package, [])) <= {DISTRIBUTION}
    spec = importlib.util.find_spec(package)
    origin = Path(spec.origin).resolve()
    installed = {Path(str(file.locate())).resolve() for file in metadata.files(DISTRIBUTION) or []}
    assert origin == ROOT / package / "__init__.py" or origin in installed
    assert origin.with_name("py.typed").is_file()


@pytest.mark.parametrize("folder", ["tests", "benchmarks"])
def test_only_the_packages_are_installed(folder: str, tmp_path: Path) -> None:
    code = f"import importlib.util; print(importlib.util.find_spec({folder!r}))"
    shown = subprocess.run([sys.executable, "-I", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert str(ROOT / folder) not in shown.stdout


def test_version_agrees() -> None:
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert metadata.version(DISTRIBUTION) == PROJECT["version"] == str(citation["version"])


KINDS = ("Added", "Changed", "Deprecated", "Removed", "Fixed", "Security")


def test_changelog_is_one() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = [line for line in changelog.splitlines() if line.startswith("#")]
    assert headings[:2] == ["# Changelog", "## [Unreleased]"]
    for release in re.split(r"^## ", changelog, flags=re.MULTILINE)[1:]:
        assert re.match(r"\[Unreleased\]\n|\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d\n", release)
        kinds = re.findall(r"^### (.*)$", release, re.MULTILINE)
        assert set(kinds) <= set(KINDS)
        assert len(kinds) == len(set(kinds))
    lines = changelog.splitlines()
    after_gaps = [n for n, line in enumerate(lines) if line.startswith("- ") and not lines[n - 1]]
    assert [n for n in after_gaps if "- " in lines[n - 2]] == []


DEPRECATED = re.findall(
    r"^- `([^`]+)`: `([^`]+)`, removed in (\d+\.\d+\.\d+)$",
    (ROOT / "docs" / "development.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)


def test_deprecated_names_are_listed_and_leave_in_time() -> None:
    current = Version(PROJECT["version"])
    assert [name for name, _, removed in DEPRECATED if Version(removed) <= current] == []
    for folder in PACKAGES:
        for path in (ROOT / folder).rglob("*.py"):
            for warned in re.findall(r'warn\(f?"(\S+?)(?:\(.*?\))? is now', path.read_text(encoding="utf-8")):
                listed = warned.replace("{name}", "")
                assert any(name.startswith(listed) for name, _, _ in DEPRECATED), f"{path}: {warned}"


def test_continuous_integration_tries_the_distribution() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert script.index('\nstep "$tests"\n') < script.index('\nstep ".ci/try_distribution"\n')
    for shell in ("run", "try_distribution"):
        subprocess.run(["bash", "-n", ROOT / ".ci" / shell], check=True)
        assert os.access(ROOT / ".ci" / shell, os.X_OK)


def test_command_is_installed() -> None:
    (script,) = metadata.distribution(DISTRIBUTION).entry_points.select(group="console_scripts", name="excite")
    assert callable(script.load())


def test_readme_begins_with_two_commands_of_one_line() -> None:
    assert len(COMMANDS) == 2
    for command in COMMANDS:
        assert command.count("\n") == 1
        subprocess.run(["bash", "-n", "-c", command], check=True)
        subprocess.run(["sh", "-n", "-c", command], check=True)
    design, tests = COMMANDS
    assert "excite design irp6" in design
    assert ".venv/bin/pytest" in tests


def test_ci_runs_the_commands_of_the_readme() -> None:
    listed = subprocess.run([ROOT / ".ci" / "run", "--list"], capture_output=True, text=True, check=True)
    assert listed.stdout == "".join(COMMANDS)
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert script.index('\nstep "$design"\n') < script.index('\nstep "$tests"\n')


def locked_versions(name: str, python: str) -> list[str]:
    """Versions that the lock states for a distribution under a version of Python, on this platform."""
    environment = default_environment() | {"python_version": python, "python_full_version": f"{python}.0"}
    return [
        version
        for pinned, version, marker in re.findall(r"^([\w.-]+)==(\S+)(?: ; (.+))?$", LOCK, re.MULTILINE)
        if canonicalize_name(pinned) == canonicalize_name(name) and (not marker or Marker(marker).evaluate(environment))
    ]


@pytest.mark.parametrize("python", ["3.11", "3.13"])
def test_lock_satisfies_direct_dependencies(python: str) -> None:
    for requirement in map(Requirement, DIRECT):
        versions = locked_versions(requirement.name, python)
        assert len(versions) == 1, requirement
        assert requirement.specifier.contains(versions[0]), requirement


def test_lock_holds_only_comments_and_pins() -> None:
    # No index, no file, no address: the lock is valid on any machine.
    lines = [line for line in LOCK.splitlines() if not line.lstrip().startswith("#")]
    assert [line for line in lines if not re.fullmatch(r"[\w.-]+==[\w.+!]+( ; [\w.*'\"=<>! ()]+)?", line)] == []


def test_the_documents_say_how_the_lock_was_made() -> None:
    made_by = next(line.lstrip("# ") for line in LOCK.splitlines() if "uv pip compile" in line)
    assert made_by in (ROOT / "docs" / "development.md").read_text(encoding="utf-8")
