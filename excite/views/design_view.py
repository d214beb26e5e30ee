"""What is shown of a design: limits, criteria, predicted accuracy, starts, and the precision that was asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from excite.design.design import Design, between_samples_text
from excite.design.design_folder import design_content
from excite.design.start_results import RANDOM_MOTIONS, or_infinite
from excite.design.stated_limits import collisions_unchecked, kept_headline, kept_text
from excite.information.matrix import CONVENTIONS
from excite.information.precision_forecast import ParameterPrecision, PrecisionForecast, PrecisionSearch
from excite.information.weighting import minimised_text
from excite.logs.log import counted
from excite.optimality.design_bound import stored_bound
from excite.registry import name_of
from excite.study.period_search import runs_text
from excite.views.comparison_view import bound_view
from excite.views.view import Drawing, View, ViewTable, asked, headed, texts
from regressors.errors import listed_names, percent
from regressors.models.mirrored_limbs import mirrored_bodies

_ASKED = ("robot", "model", "trajectory", "period", "criterion", "starts", "seed")
_CONDITION = "condition, base gautier"
_MOST_STARTS = 30
_NAMED = 3  # parameters with what they move with
_NEAR = 4  # limits of a short summary
_DRAWN = (
    Drawing("Motion and its limits over time", "motion", "motion_plot.motion_figure"),
    Drawing("Velocity over position", "phase", "world_plot.phase_figure"),
    Drawing("What the motion identifies", "spectrum", "spectrum_plot.spectrum_figure"),
    Drawing("The search", "convergence", "search_plot.convergence_figure"),
    Drawing("Distances over time", "clearance", "world_plot.clearance_figure"),
    Drawing("Tool and obstacles", "workspace", "world_plot.workspace_figure"),
    Drawing("Robot time against precision", "precision", "search_plot.precision_figure"),
)


def design_view(design: Design, *, whole: bool = True) -> View:
    """View of a design; unless it is whole, without figures and sentences that need parts of the user's own."""
    content, known = design_content(design), stored_bound(design)
    bound = None if known is None else bound_view(known)
    sought = design.precision if whole else None
    guesses = [(each.index, each.history[0]) for each in design.starts if each.history] if whole else []
    return View(
        kind="design",
        title=design.name,
        verdict=f"{_held(design)}; condition number {design.condition_number:.4g}{_of_random_motions(design)}",
        holds=design.feasible and (sought is None or sought.met),
        caution=bool(collisions_unchecked(each.limit for each in design.unchecked)),
        numbers=(
            ("condition number", f"{design.condition_number:.4g}"),
            ("limit used most", percent(max((use.use for use in design.limits), default=0.0), 3)),
            ("duration", f"{design.sequence.duration:.4g} s"),
        ),
        summary=(
            *(() if sought is None else _precision(design, sought)),
            *(_asked(design) if whole else ()),
            _kept(design, content),
            *(_transfers(design) if whole else ()),
        ),
        remarks=(*content["notes"], *(() if bound is None else bound.remarks)),
        tables=(
            _limits("limits", "Margins of the limits over continuous time", content["limits"]),
            *(() if sought is None or sought.met else _tried(design.precision_search)),
            _conditions(content),
            *(() if bound is None else bound.tables),
            *(
                _limits(f"limits-{name}", f"Margins of the limits on the {name}", content["played"][name]["limits"])
                for name in ("approach", "return")
                if name in content["played"]
            ),
            _predictions(design, content),
            *(() if sought is None else (_half_widths(sought),)),
            _starts(content["solver"], dict(guesses)),
            *_harmonics(content["solver"]),
        ),
        asked=asked(content["task"], _ASKED),
        figures=design_figures(design) if whole else (),
        filed="design",
        facts={"robot": content["robot"]["name"], "robot_sha256": content["robot"]["sha256"], **content["provenance"]},
    )


def design_figures(design: Design) -> tuple[Drawing, ...]:
    """Figures of a design: of distances where there is a world, of the search where its starts are known."""
    world = design.task.limits.world is not None
    shown = {
        "convergence": bool(design.starts),
        "clearance": world,
        "workspace": world or bool(design.shape is not None and design.shape.obstacles),
        "precision": design.precision_search is not None,
    }
    return tuple(each.of(design) for each in _DRAWN if shown.get(each.ending, True))


def _held(design: Design) -> str:
    """Whether the limits hold."""
    uses = [use for some in (design.limits, *design.transfer_limits.values()) for use in some]
    if design.broken:
        return f"Design exceeds {len(design.broken)} of {len(uses)} checked limits: {listed_names(design.broken, 3)}"
    plain = f"Design within all {len(uses)} checked limits" if uses else "Design for which no limit was checked"
    held = kept_headline((each.limit for each in design.unchecked), plain)
    return held[:1].upper() + held[1:]


def _of_random_motions(design: Design) -> str:
    """What random motions have, where it is the condition number that was minimised."""
    if design.search is None or design.search.random is None or minimised_text(design.task) != _CONDITION:
        return ""
    return f" (best of {RANDOM_MOTIONS} random motions within the limits: {design.search.random:.3g})"


def _asked(design: Design) -> Iterator[str]:
    task, minimised, moving = design.task, minimised_text(design.task), design.target.motion.labels
    value = "" if minimised == _CONDITION else f" ({design.minimised_value:.4g})"
    worth = ""  # of more rounds of the search
    if design.search is not None and design.search.left is not None:
        more = design.number_of_starts // design.search.populations
        longer = float(design.provenance["cpu_seconds"]) / design.search.populations
        worth = f"; another {more} ({longer:.2g} s) are expected to gain {100 * design.search.left:.1g} %"
    elif len(ends := sorted(start.value for start in design.starts)) > 1:
        worth = f"; the two best starts differ by {percent(abs(ends[1] / ends[0] - 1))}"
    tied = f" (one set for {listed_names(mirrored_bodies(design.target.robot))})" if task.model.symmetric else ""
    yield (
        f"{design.robot.name}: {name_of(task.model.model)} model, {', '.join(moving)} move{'s' * (len(moving) == 1)}, "
        f"{design.base.rank} base parameters{tied}; {task.trajectory.period:g} s, "
        f"{design.trajectory.family.described}; minimised: {minimised}{value}; "
        f"{counted(design.number_of_starts, 'start')}, {design.provenance['cpu_seconds']:.1f} s CPU{worth}"
    )


def _kept(design: Design, content: Mapping[str, Any]) -> str:
    """Which limits are exceeded, or what was checked and what was not; whether the search was stopped."""
    kept = kept_text(design.unchecked, (use.quantity for use in design.limits)).partition("; ")[2]
    if design.broken:
        kept = f"the motion exceeds {counted(len(design.broken), 'limit')}: {', '.join(design.broken)}"
    return f"{kept}; the search was interrupted" if content["interrupted"] else kept


def _transfers(design: Design) -> Iterator[str]:
    """Sentences on approach and return, and on the limits between the samples of the file."""
    if (both := design.approach_and_return) is not None:
        names = {"approach": "approach from home", "return": "return to home"}
        for segment, transfer in both.transfers.items():
            uses = both.limits[segment]
            broken = [use.label for use in uses if not use.holds]
            most = max(uses, key=lambda use: use.use)
            kept = f"within all limits, {most.label} used to {100 * most.use:.1f} %"
            yield (
                f"{names[segment]}: {transfer.duration:g} s ({transfer.shortest:.4g} s at the quickest), "
                f"{'BREAKS ' + ', '.join(broken) if broken else kept}"
            )
        yield f"trajectory.csv lasts {design.sequence.duration:g} s"
    if any(each.uses for each in design.between_samples):
        yield between_samples_text(design, design.between_samples)


def _precision(design: Design, forecast: PrecisionForecast) -> Iterator[str]:
    """Runs, robot time and the worst parameter, where a precision is asked for; what is too wide, and why."""
    text = runs_text(forecast.runs, forecast.seconds)
    if forecast.met:
        yield f"{text}; worst parameter {_width(forecast.worst)}"
        return
    wide, asked = forecast.too_wide, sum(p.allowed is not None for p in forecast.parameters)
    most, search = design.task.objective.max_time, design.precision_search
    yield f"out of reach within {most:g} s: after {text}, {len(wide)} of {asked} intervals are too wide"
    if search is None or search.out_of_reach is None:
        yield f"worst parameter {_width(wide[0])}"
        if len(wide) > 1:
            yield f"too wide also: {', '.join(p.name for p in wide[1:])}"
    else:
        yield from _obstacles(search.out_of_reach)


_NEVER = 1e8  # robot time that no one spends [s]


def _obstacles(found: Any) -> Iterator[str]:
    """The widest parameters, and what would separate them."""
    yield from (parameter.text for parameter in found.parameters[:_NAMED])
    if len(found.parameters) > _NAMED:
        yield f"too wide also: {', '.join(p.name for p in found.parameters[_NAMED:])}"
    best = "nothing that was tried separates them" if found.best is None else f"what helps most is {found.best.change}"
    longer = f"the same motion would take {found.robot_seconds:.4g} s of robot time"
    yield f"{longer if found.robot_seconds < _NEVER else 'no number of runs of the same motion would do'}; {best}"


def _width(p: ParameterPrecision) -> str:
    return f"{p.name}: half-width {p.half_width:.3g} of {p.allowed:.3g} {p.unit} allowed"


def _limits(name: str, title: str, uses: Sequence[Mapping[str, Any]]) -> ViewTable:
    """Limits of the motion or of a transfer: those that do not hold first, then those that are used most."""
    first = "limit" if name != "limits" else "limits used most"
    columns = headed(
        f"*{first}:text, *extreme:4, *bound:4, *unit:unit, *used:%?far from it, margin, at [s], holds:kept"
    )
    ranked = sorted(uses, key=lambda use: (use["holds"], -or_infinite(use["use"])))
    rows = []
    for u in ranked:
        # far inside a limit on one side, as of a distance, the part that is used says nothing
        used = use if (use := or_infinite(u["use"])) >= 0 or not u["holds"] else None
        rows.append((u["label"], u["extreme"], u["bound"], u["unit"], used, u["margin"], u["time"], u["holds"]))
    note = "Extremes are over every instant, not over samples: exact, or proven bounds."
    broken = {(k, 4): "bad" for k, use in enumerate(ranked) if not use["holds"]}
    how: dict[str, Any] = {"note": note} if name == "limits" else {"folded": True}
    return ViewTable(name, title, columns, tuple(rows), marked=broken, most=_NEAR, **how)


def _tried(search: PrecisionSearch | None) -> tuple[ViewTable, ...]:
    """Changes of the problem, where the precision that was asked for is out of reach."""
    if search is None or search.out_of_reach is None or not search.out_of_reach.trials:
        return ()
    columns = (*texts("tried, one at a time", brief=True), *headed("*narrower [times], *robot time [s]:4"))
    rows = tuple((trial.change, trial.narrower, trial.robot_seconds) for trial in search.out_of_reach.trials)
    return (ViewTable("tried", "What would make the intervals narrower", columns, rows),)


def _conditions(content: Mapping[str, Any]) -> ViewTable:
    meanings = {**CONVENTIONS, **content.get("conventions", {})}
    columns = headed("measure:text, value, convention:text")
    rows = tuple((name.replace("_", " "), value, meanings.get(name, "")) for name, value in content["criteria"].items())
    note = f"Minimised: {content['minimised']}."
    return ViewTable("criteria", "Condition under each convention", columns, rows, note=note)


def _predictions(design: Design, content: Mapping[str, Any]) -> ViewTable:
    predicted = content["predicted"]
    known = {each["name"]: (each["deviation"], each["after"]) for each in predicted.get("prior", ())}
    behind = any("motor_side" in each for each in predicted["parameters"])
    both, motors = ", known beforehand, both" * bool(known), ", at the motor:text" * behind
    columns = headed(f"parameter:text, standard deviation{both}, unit:unit{motors}, combination:unit")
    rows = []
    for p in predicted["parameters"]:
        prior = known.get(p["name"], (None, None)) if known else ()
        motor = (_at_the_motor(p.get("motor_side")),) if behind else ()
        rows.append((p["name"], p["standard_deviation"], *prior, p["unit"], *motor, p["expression"]))
    noise = sorted(set(predicted["noise"]))
    sizes = f"{noise[0]:g}" + (f" to {noise[-1]:g}" if len(noise) > 1 else "")
    sizes += f" {' or '.join(dict.fromkeys(unit for _, unit in predicted['equations']))}"
    assumed = " (assumed)" if design.task.objective.noise is None else ""
    note = f"Of one run, for noise of {sizes}{assumed} in each row, independent from instant to instant."
    return ViewTable("predicted", "Parameters and their predicted accuracy", columns, tuple(rows), note=note)


def _at_the_motor(side: Mapping[str, Any] | None) -> str:
    """Deviation of the rotor inertia itself, where the parameter is one at the drive coordinate."""
    return "" if side is None else f"{side['name']}: {side['standard_deviation']:.3g} {side['unit']}"


def _half_widths(forecast: PrecisionForecast) -> ViewTable:
    """Predicted and allowed half-width of every parameter, where a precision is asked for."""
    title = (
        f"Half-widths of {100 * forecast.level:g} % intervals after {counted(forecast.runs, 'run')}, "
        f"with probability {100 * forecast.probability:g} %"
    )
    rows = tuple(
        (p.name, p.half_width, p.allowed, p.unit, None if p.allowed is None else p.use) for p in forecast.parameters
    )
    return ViewTable("half-widths", title, headed("parameter:text, half-width, allowed, unit:unit, used:%"), rows)


def _starts(solver: Mapping[str, Any], began: Mapping[int, float]) -> ViewTable:
    """How each start ended, the best first."""
    columns = headed("start, began at, ended at, iterates, CPU [s], how it ended:text")
    starts = sorted(solver["starts"], key=lambda s: or_infinite(s["value"]))
    rows = tuple(
        (s["index"], began.get(s["index"]), s["value"], s["iterations"], s["cpu_seconds"], s["status"])
        for s in starts[:_MOST_STARTS]
    )
    return ViewTable("starts", "Starts of the search", columns, rows)


def _harmonics(solver: Mapping[str, Any]) -> tuple[ViewTable, ...]:
    """What each number of harmonics brought, where the search chose it."""
    rows = tuple((each["harmonics"], each["value"], each["cpu_seconds"]) for each in solver.get("harmonics", ()))
    title = "Numbers of harmonics that were tried"
    return (ViewTable("harmonics", title, headed("harmonics, criterion, CPU [s]"), rows),) if rows else ()
