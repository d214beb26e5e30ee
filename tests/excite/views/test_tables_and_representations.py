"""What Python and notebooks show: tables of results as columns, HTML, and representations that fit a screen."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import written_results as made
from reported import ParsedPage

import excite
from excite.trajectories.fourier import Fourier
from excite.views.view import Format, ViewTable, view_of
from regressors.errors import InputError, UnknownName
from regressors.models.differential import DifferentialModel
from regressors.readers.library import built_in

LINES, WIDTH = 20, 100


RESULTS: dict[str, Callable[[], Any]] = {
    "design": lambda: made.design("new"),
    "friction fit": lambda: made.friction_fit("new"),
    "friction plan": lambda: made.plan("old"),
    "gains": lambda: made.gains("new"),
    "payload": lambda: made.payload("new"),
    "payload motion": lambda: made.payload_motion("new"),
    "result": lambda: made.result("new"),
    "simulation": lambda: made.simulation("new"),
    "study": lambda: made.study("new"),
    "verification": lambda: made.verification("new"),
}


@pytest.mark.parametrize("name", RESULTS)
def test_tables_are_columns_and_the_notebook_shows_the_first(name: str) -> None:
    result = RESULTS[name]()
    view = view_of(result)
    for table in view.tables:
        columns = result.table(table.name)
        assert len(columns) == len(table.columns), "two columns have the same name"
        np.testing.assert_equal([*zip(*columns.values(), strict=True)], [tuple(row) for row in table.rows])
        pa.table({heading: [str(x) for x in column] for heading, column in columns.items()})
    page = ParsedPage(text := result._repr_html_())
    assert {each.tag for each in page.elements}.isdisjoint({"script", "style", "html", "button"})
    shown = " ".join("".join(page.elements[k].text) for k in range(len(page.elements)))
    assert view.title in shown
    assert [each.attributes["data-table"] for each in page.of("table")] == [t.name for t in view.tables[:1] if t.rows]
    for table in view.tables[:1]:
        assert len(page.of("tr")) == (len(table.rows) + 1) * bool(table.rows)
        numbers = [k for k, each in enumerate(table.columns) if each.format not in (Format.TEXT, Format.UNIT)]
        expected = [[row[k] for k in numbers if isinstance(row[k], float)] for row in table.rows]
        found = page.numbers(table.name) if table.rows else []
        assert all(set(filter(np.isfinite, row)) <= set(of) for row, of in zip(expected, found, strict=True))
    assert "Traceback" not in text


def test_a_table_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(UnknownName, match=r"no table of Verification named 'torque'.*torques, "):
        made.verification("new").table("torque")


def test_what_cannot_be_shown_is_shown_by_its_representation(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: object) -> None:
        raise InputError("a part is not given")

    monkeypatch.setattr("excite.views.design_view.design_view", refuse)
    assert "&lt;Design of irp6" in made.design("new")._repr_html_()


def test_texts_of_others_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    table = ViewTable("t", "<i>", (), ())
    view = dataclasses.replace(view_of(made.verification("new")), title="<script>", tables=(table,))
    monkeypatch.setattr("excite.views.verification_view.verification_view", lambda _: view)
    assert "<script>" not in made.verification("new")._repr_html_()


def parts_of(thing: Any, depth: int = 3) -> Iterator[Any]:
    """An object of these packages, and what it holds."""
    if type(thing).__module__.split(".")[0] in ("excite", "constraints", "regressors"):
        yield thing
        if depth and dataclasses.is_dataclass(thing):
            for field in dataclasses.fields(thing):
                yield from parts_of(getattr(thing, field.name, None), depth - 1)


def examples() -> Iterator[Any]:
    """Public objects of sizes that occur."""
    for result in RESULTS.values():
        yield from parts_of(result())
    for name in excite.built_in_names():
        yield excite.load_robot(name)
    design, log = made.design("new"), made.simulation("new").measured
    yield from (
        log,
        excite.Log.from_arrays([0.0, 1.0], np.zeros((2, 30)), joints=[f"a_long_name_{k}" for k in range(30)]),
    )
    yield from (design.samples, made.guess("old"), excite.Tolerances(), excite.FitSettings())
    many = np.ones((60, 40))
    names = tuple(f"parameter {k}" for k in range(40))
    yield excite.TimeCourse("log", names, names, many[:, 0], many, many, 2.6, many[:, 0], many[0], "truth")
    yield excite.Estimate("weighted", names, names, many[0], np.eye(40), many, 9)
    yield excite.KnownGains(names[:7], np.ones(7), np.eye(7), "calibrated")
    beliefs = tuple(excite.Belief(name, 1.0, 0.1) for name in names[:10])
    yield from (excite.Objective(prior=beliefs), beliefs[0], excite.Column("m1", "kg", "body", 1))
    yield excite.PrecisionInHand("X1", "m", "kg", 1.0, 2.0, 3.0, 4.0)
    motion = excite.TaskMotion("pick", ("a", "b", "c"), *(np.random.default_rng(0).normal(size=(3, 300, 3))))
    yield from (
        motion,
        excite.TaskTorques(0.05, motion),
        excite.TorqueDeviation(np.ones((70, 13))),
        excite.Payload((1.0, 0, 0, 0, 1.0, 0, 0, 1.0, 0, 1.0)),
    )
    yield from (excite.ImpactPulse("a", 1.0, 2.0), excite.PlausibleTorqueLimit(0.2), excite.Collisions(design.shape))
    yield from (excite.ToolBox((0.1, -0.2, 0.3), (0.4, 0.5, 0.6)), excite.ToolSpeed(0.25))


def parameters(kind: type) -> list[inspect.Parameter]:
    """Of a constructor."""
    return list(inspect.signature(kind).parameters.values())


def test_models_and_families_say_what_they_are() -> None:
    assert repr(Fourier(8.0, 3)) == "<Fourier: 3 harmonics over 8 s>"
    assert repr(DifferentialModel(built_in("irp6"))).startswith("<DifferentialModel of irp6: ")


def test_representations_of_public_objects_fit_a_screen() -> None:
    public = {name: kind for name in dir(excite) if isinstance(kind := getattr(excite, name), type)}
    generated = {name: kind for name, kind in public.items() if hasattr(kind.__repr__, "__wrapped__")}  # by dataclasses
    bare = [kind() for kind in generated.values() if all(p.default is not p.empty for p in parameters(kind))]
    sizes: dict[str, int] = {}
    for thing in (*examples(), *bare):
        lines = sum(max(1, -(-len(line) // WIDTH)) for line in repr(thing).splitlines())
        sizes[type(thing).__name__] = max(lines, sizes.get(type(thing).__name__, 0))
    assert {name: lines for name, lines in sizes.items() if name in public and lines > LINES} == {}
    assert {"Robot", "Samples", "Task", "Log", "Recipe"} <= sizes.keys()
    assert generated.keys() - sizes.keys() == set()
