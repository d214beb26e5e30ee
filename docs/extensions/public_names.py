"""Pages of the API: every public name of `excite` in the group of its room, with its docstring.

The pages are written to ``docs/reference/api``, which git ignores, before Sphinx looks for pages.
"""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

FOLDER = Path(__file__).resolve().parents[1] / "reference" / "api"
# the rooms of each group; the longest match decides
GROUPS = {
    "Robots and models": ("regressors",),
    "Motions": ("excite.trajectories",),
    "Limits": ("constraints",),
    "Designs": (
        "excite.design",
        "excite.tasks",
        "excite.optimality",
    ),
    "Criteria and solvers": ("excite.information", "excite.tasks.criteria", "excite.design.solvers"),
    "Simulation": ("excite.simulation",),
    "How uncertain": ("excite.study",),
    "Logs and identification": (
        "excite.logs",
        "excite.identification",
    ),
    "Verification": ("excite.verification", "excite.tasks.further_settings"),
    "Friction": ("excite.friction", "excite.tasks.friction_file"),
    "Payloads": ("excite.payload",),
    "Exports": ("excite.export",),
    "Figures and reports": ("excite.views",),
    "Errors": ("excite.errors", "regressors.errors"),
}


def places() -> dict[str, str]:
    """Module of every public name, the built-in parts included."""
    import excite

    return dict(sorted({**excite._built_in_parts(), **excite._PLACES}.items(), key=lambda item: item[0].lower()))


def group_of(module: str) -> str:
    """Group of a module.

    Raises
    ------
    ExtensionError
        No group has its room.
    """
    rooms = [
        (len(room), group) for group, all_of in GROUPS.items() for room in all_of if f"{module}.".startswith(f"{room}.")
    ]
    if not rooms:
        raise ExtensionError(f"docs/extensions/public_names.py: no group of the API has the room of {module}")
    return max(rooms)[1]


def groups() -> dict[str, list[str]]:
    """Public names of each group that has any."""
    found: dict[str, list[str]] = {group: [] for group in GROUPS}
    for name, module in places().items():
        found[group_of(module)].append(name)
    return {group: names for group, names in found.items() if names}


def page(group: str, names: list[str]) -> str:
    """Page of one group: a table of its names, then each with its docstring."""
    import excite

    def directive(name: str) -> str:
        value = getattr(excite, name)
        if not isinstance(value, type):
            return f".. autofunction:: {name}\n"
        members = (
            ""
            if issubclass(value, Exception)
            else "   :members:\n   :inherited-members:\n   :exclude-members: __init__\n"
        )
        return f".. autoclass:: {name}\n{members}"

    table = "\n   ".join([".. autosummary::", ":nosignatures:", "", *names])
    head = [group, "=" * len(group), "", ".. currentmodule:: excite", "", table, "", *map(directive, names)]
    return "\n".join(head + (_failures() if group == "Errors" else []))


def _failures() -> list[str]:
    """What is raised where nothing was wrong with the input, in `excite.errors`."""
    from excite import errors

    own = (name for name in errors.__all__ if name not in places())
    return [".. currentmodule:: excite.errors", "", *(f".. autoclass:: {name}\n" for name in own)]


def file_name(group: str) -> str:
    """Name of a group's page."""
    return group.lower().replace(" ", "-")


def write(folder: Path) -> None:
    """Write all pages, and remove those of groups that are no more."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {f"{file_name(group)}.rst": page(group, names) for group, names in groups().items()}
    toctree = "\n   ".join(
        [".. toctree::", ":maxdepth: 1", "", "../names", *(name.removesuffix(".rst") for name in texts)]
    )
    texts["index.rst"] = f"Python API\n==========\n\n{HEAD}\n\n{toctree}\n"
    for old in folder.glob("*.rst"):
        if old.name not in texts:
            old.unlink()
    for name, text in texts.items():
        file = folder / name
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


HEAD = """Every name below is an attribute of `excite`, imported when it is first used. What begins with a capital is a
class; whatever a command does, one of the functions does too."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages."""
    write(FOLDER)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
