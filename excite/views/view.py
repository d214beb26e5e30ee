"""A view of a result: a verdict, sentences, tables of values with their units, and figures, in no form yet."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import MISSING, dataclass, field, replace
from enum import Enum
from itertools import compress
from typing import Any

from excite.registry import import_attribute
from excite.tasks.option import options_of
from excite.tasks.task import PARTS
from regressors.errors import InputError, check_names


class Format(Enum):
    """How the values of a column are written; a text stands for itself in every column."""

    TEXT = "text"
    UNIT = "unit"  # of the numbers beside it
    NUMBER = ""
    PERCENT = "%"  # of a fraction
    KEPT = "kept"  # whether a limit holds


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    heading: str  # with the unit where all values have the same, such as ``at [s]``
    format: Format = Format.NUMBER
    brief: bool = False  # True for the few columns that a short summary shows
    wide: bool = False  # True for a column of long texts, which only a page has room for
    missing: str = ""  # stands for None and for what is not finite, such as ``never``; a dash if not given
    digits: int = 3  # significant digits of its numbers in a short summary


@dataclass(frozen=True)
class ViewTable:
    """A table of values."""

    name: str  # what programs find it by
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Any, ...], ...]  # text, or numbers in SI units
    folded: bool = False  # whether a page shows it only when it is asked for, and a terminal not at all
    note: str = ""  # stands below it
    # ``bad`` or ``best`` by the row and the column of the values that a reader should see
    marked: Mapping[tuple[int, int], str] = field(default_factory=dict)
    most: int = 8  # rows of a short summary

    @property
    def by_heading(self) -> dict[str, list[Any]]:
        """Its columns by their headings, of which a second ``unit`` also has the heading before it, with all digits."""
        columns: dict[str, list[Any]] = {}
        for k, heading in enumerate(column.heading for column in self.columns):
            name = f"{heading} ({self.columns[k - 1].heading})" if heading in columns else heading
            columns[name] = [row[k] for row in self.rows]
        return columns

    @property
    def brief(self) -> ViewTable:
        """The columns of a short summary."""
        kept = [column.brief for column in self.columns]
        columns, *rows = (tuple(compress(each, kept)) for each in (self.columns, *self.rows))
        return replace(self, columns=columns, rows=tuple(rows), marked={})


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when it is asked for."""

    title: str
    ending: str  # the name of its file, or its end
    function: str  # ``module.function`` of `excite.views`, which imports matplotlib
    arguments: tuple[Any, ...] = ()

    def of(self, *arguments: Any) -> Drawing:
        """The figure of something."""
        return replace(self, arguments=arguments)

    def draw(self) -> Any:
        """The matplotlib figure."""
        return import_attribute(f"excite.views.{self.function}")(*self.arguments)


@dataclass(frozen=True)
class View:
    """Everything that is shown of a result."""

    title: str
    verdict: str  # in a sentence
    kind: str = ""  # of result, in one or two words
    holds: bool | None = None  # whether what was asked holds; None where nothing was judged
    caution: bool = False  # whether something that may break the robot was not checked
    numbers: tuple[tuple[str, str], ...] = ()  # the three that a page begins with, and what they are
    summary: tuple[str, ...] = ()  # the sentences with the numbers that matter most
    against: tuple[str, ...] = ()  # reasons against the result
    remarks: tuple[str, ...] = ()  # what was assumed, what was not checked, and what does not affect the verdict
    asked: tuple[tuple[str, str], ...] = ()  # what was asked, as names and values
    tables: tuple[ViewTable, ...] = ()
    figures: tuple[Drawing, ...] = ()
    filed: str = ""  # the kind of result, as a folder's manifest has it, beside which figures are written
    stem: str = ""  # what the names of its figures' files begin with
    facts: Mapping[str, Any] = field(default_factory=dict)  # provenance

    def drawn(self) -> dict[str, Any]:
        """Its figures by the names of their files."""
        return {f"{self.stem}{each.ending}": each.draw() for each in self.figures}


# views by the classes of what they show; a class is not imported for what is of another one
_VIEWS = {
    "excite.design.campaign.Campaign": "campaign_view.campaign_view",
    "excite.design.design.Design": "design_view.design_view",
    "excite.design.friction_runs.friction_plan.FrictionPlan": "friction_views.friction_plan_view",
    "excite.design.sweeps.sweep_table.SweepTable": "campaign_view.cells_view",
    "excite.friction.friction_fit.FrictionFit": "friction_views.friction_fit_view",
    "excite.identification.identification.Identification": "identification_view.identification_view",
    "excite.identification.servo_result.ServoResult": "servo_view.servos_view",
    "excite.optimality.design_bound.DesignBound": "comparison_view.bound_view",
    "excite.payload.calibrate_gains.CalibratedGains": "experiment_views.gains_view",
    "excite.payload.payload_motion.PayloadMotion": "experiment_views.payload_motion_view",
    "excite.payload.payload_result.PayloadResult": "experiment_views.payload_view",
    "excite.simulation.simulation.SimulatedLog": "verification_view.simulation_view",
    "excite.simulation.simulation.Simulation": "verification_view.simulation_view",
    "excite.study.next_motion.NextMotion": "experiment_views.next_motion_view",
    "excite.study.predict_accuracy.AccuracyPrediction": "experiment_views.accuracy_view",
    "excite.study.time_study.TimeStudy": "experiment_views.study_view",
    "excite.verification.verification.Verification": "verification_view.verification_view",
    "excite.verification.verify_servos.ServoVerification": "servo_view.servo_verification_view",
}


def view_of(result: Any) -> View:
    """The view of a result, or a view as it is."""
    if isinstance(result, View):
        return result
    names = [f"{kind.__module__}.{kind.__qualname__}" for kind in type(result).__mro__]
    known = next(filter(None, map(_VIEWS.get, names)), None)
    if known is None:
        raise InputError(
            "expected a design, an identification, a verification, a study, a friction plan, a friction fit, a payload "
            f"motion or the table of a campaign to draw, given {type(result).__name__}"
        )
    view: View = import_attribute(f"excite.views.{known}")(result)
    return view


def table_of(result: Any, name: str) -> dict[str, list[Any]]:
    """Columns of one table of a result, by their headings."""
    tables = {table.name: table for table in view_of(result).tables}
    check_names(f"table of {type(result).__name__}", [name], tables)
    return tables[name].by_heading


def raised(text: str) -> str:
    """A unit or a sum with raised exponents, such as ``kg m²``."""
    return text.replace("^2", "²").replace("^3", "³")


def text_of(value: Any) -> str:
    """A value of a task or a recipe in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {text_of(each)}" for name, each in value.items() if each is not None)
    if isinstance(value, Iterable) and not isinstance(value, str):
        return ", ".join(text_of(each) for each in value) or "none"
    return "none" if value is None else str(value)


_BESIDE = ("executor", "workers")  # change nothing in the result
_LONG = 200  # letters


def asked(task: Mapping[str, Any], always: Collection[str]) -> tuple[tuple[str, str], ...]:
    """Some options of a task, and every other one that is not the default, as names and texts."""
    limits = {f"{name}_limit": value for name, value in (task.get("limits") or {}).items()}
    given = {**{name: value for name, value in task.items() if name not in ("limits", *_BESIDE)}, **limits}
    options = [each for part in PARTS.values() for each, _ in options_of(part)]
    usual = {"snap_angles": True, **{each.name: None if each.default is MISSING else each.default for each in options}}
    texts = {
        name.replace("_", " "): text_of(value)
        for name, value in given.items()
        if name in always or not _is_default(value, usual.get(name))
    }
    cut = f"{{:.{_LONG - 1}}}\N{HORIZONTAL ELLIPSIS}".format
    return tuple((name, text if len(text) <= _LONG else cut(text)) for name, text in texts.items())


def _is_default(value: Any, usual: Any) -> bool:
    return value is None or value == usual or (isinstance(value, list) and tuple(value) == usual)


def texts(*headings: str, **how: Any) -> tuple[Column, ...]:
    """Columns of texts."""
    return tuple(Column(heading, Format.TEXT, **how) for heading in headings)


def headed(headings: str) -> tuple[Column, ...]:
    """Columns, as ``*drive:text, x:2, used:%?never``: starred in a summary; format or digits; what stands for None."""
    columns = []
    for each in headings.split(", "):
        named, _, missing = each.removeprefix("*").partition("?")
        heading, _, form = named.partition(":")
        digits = int(form) if form.isdigit() else Column.digits
        kind = Format("" if form.isdigit() else form)
        columns.append(Column(heading, kind, each.startswith("*"), missing=missing, digits=digits))
    return tuple(columns)
