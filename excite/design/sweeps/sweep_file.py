"""Sweep files: YAML that states the options of many designs at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from types import GenericAlias
from typing import Any

from pydantic import BaseModel

from excite.design.sweeps.cell import Cell, cell_name, value_name
from excite.design.task_file import beside, option_types, options_schema, task_from_options
from excite.tasks.task import Task
from regressors.errors import ExciteError, InputError
from regressors.quoting import listed_names, shortened
from regressors.readers.documents import Document, FieldPath, read_document, validate
from regressors.readers.library import built_in_names

MOST_CELLS = 10_000
_WHERE = ("executor", "workers")  # options that say where a single design runs: given for the whole sweep
_LONGEST_LABEL = 40
_NAME = "name"
Values = Mapping[str, Any]
_Chosen = tuple[str, dict[str, str], dict[str, Any]]


def read_sweep_file(path: str | Path) -> list[Cell]:
    """Read the cells of a sweep file: the product of its ``grid``, less ``exclude``, then those of ``include``.

    ``grid`` has lists of values by the names of options of a task file; or, where values are long, mappings of short
    labels to values. ``common`` has options of all cells. ``exclude`` is a list of combinations that are left out, by
    some of the options of the grid; ``include`` is a list of further cells, each with options beside ``common``.
    """
    path = Path(path)
    document = read_document(path, "sweep file")
    content = validate(document, _schema(document)).model_dump(exclude_none=True)
    grid = {option: _labelled(document, option, content["grid"][option]) for option in _given(document, "grid", {})}
    included = content.get("include", [])
    count = math.prod(map(len, grid.values())) * bool(grid) + len(included)
    if count > MOST_CELLS:
        raise InputError(f"{path}: {count} cells are more than the {MOST_CELLS} that a sweep may have")
    exclude = [
        _excluded(document, grid, number, combination) for number, combination in enumerate(content.get("exclude", []))
    ]
    chosen = [*_product(grid, exclude), *_included(_given(document, "include", []), included)]
    _check_names(document, [name for name, _, _ in chosen])
    return [
        Cell(name, _task(path, name, {**content.get("common", {}), **options}), labels)
        for name, labels, options in chosen
    ]


def _schema(document: Document) -> type[BaseModel]:
    """Schema of a sweep file; each option of a grid is a list, or a mapping of labels to values, as it is given."""
    types = {name: kind for name, kind in option_types().items() if name not in _WHERE}
    content = document.content
    given = content.get("grid") if isinstance(content, dict) else None
    given = given if isinstance(given, dict) else {}
    labelled = {name for name, values in given.items() if isinstance(values, dict)}
    several = {
        name: GenericAlias(dict, (str, kind)) if name in labelled else _list_of(kind) for name, kind in types.items()
    }
    one = str | bool | int | float | list[Any]
    sections = {
        "common": options_schema("Common", types),
        "grid": options_schema("Grid", several),
        "exclude": _list_of(options_schema("Combination", dict.fromkeys(given, one))),
        "include": _list_of(options_schema("Included", {**types, _NAME: str})),
    }
    return options_schema("Sweep", sections)


def _list_of(kind: Any) -> GenericAlias:
    return GenericAlias(list, (kind,))


def _given(document: Document, key: str, otherwise: Any) -> Any:
    """A section as it is written, with the order of its keys, and with whole numbers as such."""
    content: Any = document.content
    return otherwise if content.get(key) is None else content[key]


def _labelled(document: Document, option: str, values: list[Any] | dict[str, Any]) -> dict[str, Any]:
    """Values of one option of the grid by their labels, which are unique."""
    place: FieldPath = ("grid", option)
    if not values:
        raise document.error([(place, "has no value")])
    if isinstance(values, dict):
        bad = [label for label in values if value_name(label) != label or len(label) > _LONGEST_LABEL]
        if bad:
            what = f"labels are letters, digits and . _ + -, {_LONGEST_LABEL} at most, given {shortened(bad[0])}"
            raise document.error([(place, what)])
        return values
    labelled = dict(zip(map(value_name, _given(document, "grid", {})[option]), values, strict=True))
    if len(labelled) < len(values):
        raise document.error([(place, "has a value twice")])
    return labelled


def _product(grid: Mapping[str, Values], exclude: list[dict[str, str]]) -> Iterator[_Chosen]:
    """Names, labels and options of the cells of a grid."""
    for labels in product(*grid.values()) if grid else ():
        cell = dict(zip(grid, labels, strict=True))
        if not any(all(cell[name] == its for name, its in left_out.items()) for left_out in exclude):
            yield cell_name(cell), cell, {name: grid[name][label] for name, label in cell.items()}


def _excluded(document: Document, grid: Mapping[str, Values], number: int, combination: Values) -> dict[str, str]:
    """Labels of a combination that is left out."""
    if not combination:
        raise document.error([(("exclude", number), "names no option of the grid")])
    wanted = {}
    for name, value in combination.items():
        label = value if isinstance(value, str) and value in grid[name] else value_name(value)
        if label not in grid[name]:
            what = f"is not a value of the grid; available: {listed_names(grid[name])}"
            raise document.error([(("exclude", number, name), what)])
        wanted[name] = label
    return wanted


def _included(written: list[Values], include: list[Values]) -> Iterator[_Chosen]:
    """Names, labels and options of further cells, as written and as validated."""
    for text, options in zip(written, include, strict=True):
        labels = {name: value_name(value) for name, value in text.items() if name != _NAME}
        name = options.get(_NAME)
        own = {name: value for name, value in options.items() if name != _NAME}
        yield cell_name(labels) if name is None else value_name(name), labels, own


def _check_names(document: Document, names: list[str]) -> None:
    if not names:
        raise document.error([((), "has no cell: state options in 'grid', or cells in 'include'")])
    known: set[str] = set()
    for name in names:
        if not name or name.casefold() in known:  # some file systems do not tell the cases of letters apart
            what = (
                f"has two cells named {shortened(name)}; give one of them another 'name'" if name else "has no option"
            )
            raise document.error([(("include",), what)])
        known.add(name.casefold())


def _task(path: Path, name: str, options: dict[str, Any]) -> Task:
    robot = options.get("robot")
    if robot is None:
        raise InputError(f"{path}: cell {name} has no robot; state one in 'common' or 'grid'")
    if robot not in built_in_names():
        options["robot"] = str(path.parent / robot)
    try:
        return task_from_options(beside(path.parent, options))
    except ExciteError as error:
        raise InputError(f"{path}: cell {name}: {error}") from error
