"""A report: one HTML page that needs nothing else."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from constraints.geometry import World
from excite.design.campaign import Campaign
from excite.design.design import Design
from excite.identification.identification import Identification
from excite.storage.records import complete
from excite.storage.result_folder import check_free, result_file, write_file
from excite.views.campaign_view import designs_of
from excite.views.identification_view import side_by_side_view
from excite.views.page_text import PageSection, page_text
from excite.views.player_data import matches
from excite.views.player_log import Appearance
from excite.views.sections import comparison_section, section_of
from excite.views.subjects import Filed, Subject, subjects_of
from regressors.arguments import checked
from regressors.errors import ExciteError, InputError

_ENDINGS = (".html", ".htm")


@checked
def write_report(
    paths_or_objects: object,
    out: str | Path,
    replace: bool = False,
    *,
    robot_file: str | Path | None = None,
    part: str | Collection[str] = (),
) -> Path:
    """Write one self-contained HTML page on designs, campaigns, identifications, verifications, or several of them.

    The page has the verdict in words, what was asked and what was assumed, figures, tables, a 3D player of each
    design's motion, and how to repeat it. It needs no network and no other file, and its content policy forbids both.
    Several designs are compared under the metrics of the first one, several identifications parameter by parameter.

    Parameters
    ----------
    paths_or_objects : path, object, or several
        Folders of results, their files, what ``excite plan --json`` prints, or designs, results, verifications and
        campaigns.
    out : path
        Ends in ``.html``.
    replace : bool
        Replace an existing file, when the new one is complete.
    robot_file : path, optional
        URDF of the robot, whose meshes the player then shows; without it, capsules, or lines through the joints'
        frames. A design does not store meshes.
    part : str or collection of str
        User-defined parts, as ``module:Name``, that may be imported where a file names them.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    InputError
        Nothing to report on, files that cannot be read or were changed since they were written, a robot file of another
        robot, a file that is already there, or one that cannot be written.
    """
    page = Path(out)
    if page.suffix.lower() not in _ENDINGS:
        raise InputError(f"{page}: expected a name that ends in .html")
    with result_file(page):
        check_free(page, replace=replace)
        text = report_text(paths_or_objects, robot_file=robot_file, part=part)
        write_file(page, text.encode("utf-8"), replace=replace)
    return page


def report_text(
    paths_or_objects: object, *, robot_file: str | Path | None = None, part: str | Collection[str] = ()
) -> str:
    """The page of `write_report` as text."""
    single = isinstance(paths_or_objects, str | Path) or not isinstance(paths_or_objects, Iterable)
    given = [paths_or_objects] if single else list(paths_or_objects)  # type: ignore[call-overload]
    subjects = subjects_of(given, (part,) if isinstance(part, str) else part)
    if robot_file is not None:
        _check_robot(subjects, str(robot_file))
    looks = Appearance(None if robot_file is None else str(robot_file), _shapes(subjects))
    sections = [_section(each, f"s{k}", looks, subjects) for k, each in enumerate(subjects)]
    return page_text([*_comparisons(subjects), *sections])


def _shapes(subjects: Iterable[Subject]) -> dict[str, World]:
    """Shapes of robots that designs hold, by the hashes of their descriptions."""
    designs = [(each, each.task.limits.world) for each in subjects if isinstance(each, Design)]
    known = {d.robot.sha256(): world if isinstance(world, World) else d.shape for d, world in designs}
    return {name: shape for name, shape in known.items() if shape is not None}


def _check_robot(subjects: Iterable[Subject], file: str) -> None:
    known = [each for each in subjects if isinstance(each, Design | Identification)]
    if not any(matches(each.robot, each.task, file) for each in known):
        robots = ", ".join(dict.fromkeys(each.robot.name for each in known)) or "none is given"
        raise InputError(f"`robot_file`: {file} does not describe the robot of a design or a result here: {robots}")


def _comparisons(subjects: Sequence[Subject]) -> list[PageSection]:
    """Of several designs, without those of a campaign, which are for different parameters; of several results."""
    designs = [each for each in subjects if isinstance(each, Design)]
    for campaign in (each for each in subjects if isinstance(each, Campaign)):
        own = designs_of(campaign, designs)
        designs = [each for each in designs if each not in own]
    results = [each for each in subjects if isinstance(each, Identification)]
    sections = [comparison_section(designs)] if len(designs) > 1 else []
    return sections + ([PageSection(side_by_side_view(results))] if len(results) > 1 else [])


def _section(subject: Subject, prefix: str, looks: Appearance, of_page: Sequence[Subject]) -> PageSection:
    """Section of a subject; of one that was read from a file, entries that are missing are named."""
    try:
        return section_of(subject, prefix, looks, of_page)
    except ExciteError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        if (source := _source(subject)) is None:
            raise
        with complete(*source):
            raise error


def _source(subject: Subject) -> tuple[Path, str] | None:
    if isinstance(subject, Design | Identification):
        kind = "design" if isinstance(subject, Design) else "result"
        return None if subject.folder is None else (subject.folder, kind)
    return (subject.path, type(subject.record).__name__.lower()) if isinstance(subject, Filed) else None
