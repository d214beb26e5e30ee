"""Commands: their help in one screen, options below headings, all of them with ``--help-all``, any by ``--set``."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from typing import Any

import click

from excite.cli.lazy import CONTEXT
from excite.cli.streams import form_options, loudness_options
from excite.tasks.task import PLACE
from regressors.errors import shortened

LINES = 60  # of a help
_WIDEST = 27  # characters of an option before its text begins on the next line
_SET, _HELP_ALL = "set_options", "help_all"
OUTPUT, OTHER = "Output", "Other"
_OF_PARTS: Mapping[str, str] = {
    "installation": "Robot",
    "model": "Model",
    "trajectory": "Motion",
    "objective": "Criterion",
    "limits": "Limits",
    "search": "Search",
    "output": "Home and rehearsal",
}
_SHARED: Mapping[str, tuple[str, ...]] = {
    "Robot": ("base_link", "tip", "snap_angles", "xacro"),
    "Limits": ("world", "support"),
    "Logs": ("mapping", "drop", "rows", "without_rows", "loaded", "without"),
    OUTPUT: ("out", "rate"),
    OTHER: ("parts", _SET, _HELP_ALL),
}


class FurtherOption(click.Option):
    """An option that only ``--help-all`` lists."""


further_option = partial(click.option, cls=FurtherOption)


class Command(click.Command):
    """Command with the options that every command has, listed below headings."""

    def __init__(self, *args: Any, groups: Mapping[str, Sequence[str]] | None = None, **options: Any) -> None:
        super().__init__(*args, **{"context_settings": {**CONTEXT, "show_default": True}, **options})
        self.groups = dict(groups or {})
        taken = {name for param in self.params for name in param.opts}
        self.params += [*form_options(taken), *loudness_options(), *_options_of_options()]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words of the command, those that ``--set`` stands for before the others."""
        return super().parse_args(ctx, args if ctx.resilient_parsing else [*self._set_words(ctx, args), *args])

    def visible_options(self, ctx: click.Context) -> list[click.Option]:
        """Every option that is not hidden."""
        return [each for each in self.get_params(ctx) if isinstance(each, click.Option) and not each.hidden]

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options below their headings, their texts in one column."""
        found: dict[str, list[tuple[str, str]]] = {}
        whole = _HELP_ALL in ctx.meta
        for option in self.visible_options(ctx):
            record = option.get_help_record(ctx)
            if record is not None and (whole or not isinstance(option, FurtherOption)):
                shown = record if whole else _shortened(*record, option)
                found.setdefault(heading_of(str(option.name), self.groups), []).append(shown)
        names = [name for rows in found.values() for name, _ in rows]
        column = max((min(len(name), _WIDEST) for name in names), default=0)
        for heading in in_order(found, self.groups):
            with formatter.section(heading):
                formatter.write_dl([(f"{name:<{column}}", text) for name, text in found[heading]], col_max=_WIDEST)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write examples and notes, in the short help as many as there is room for, and where the rest is."""
        if _HELP_ALL in ctx.meta:
            super().format_epilog(ctx, formatter)
            return
        room = LINES - formatter.getvalue().count("\n") - 2
        for paragraph in inspect.cleandoc(self.epilog or "").split("\n\n"):
            lines = ["", *_written(ctx, paragraph).splitlines()]
            rows = [1 + len(line) // (formatter.width + 2) for line in lines]
            kept = sum(sum(rows[: k + 1]) <= room for k in range(len(lines)))
            if kept < 3 and kept < len(lines):
                break
            formatter.write("\n".join([*lines[:kept], ""]))
            room -= sum(rows[:kept])
        count = len(self.visible_options(ctx))
        formatter.write(f"\nAll {count} options: {ctx.command_path} --help-all; set any by --set NAME=VALUE\n")

    def _set_words(self, ctx: click.Context, args: Sequence[str]) -> list[str]:
        """The options that ``--set`` names, as they are typed otherwise."""
        given, _, _ = self.make_parser(ctx).parse_args(list(args))
        if any(given.get(str(each.name)) for each in self._of_help(ctx)):
            return []
        settings = [self._setting(ctx, text) for text in given.get(_SET) or ()]
        for option in {each for each, _, _ in settings}:
            own = [value for each, _, value in settings if each is option]
            typed = [given[str(option.name)]] if option.name in given else []
            values = [*typed, *([own] if option.multiple else own)]
            if len(values) > 1 and len({repr(_converted(ctx, option, each)) for each in values}) > 1:
                raise click.UsageError(f"{option.opts[-1]} is given twice, with different values; give one", ctx)
        return [word for option, word, _ in settings if option.name not in given]

    def _setting(self, ctx: click.Context, text: str) -> tuple[click.Option, str, Any]:
        """Option, word and unconverted value of ``NAME=VALUE``."""
        name, equals, value = text.partition("=")
        names = dict(self._names(ctx))
        if not equals:
            raise click.UsageError(f"--set: expected NAME=VALUE, given {shortened(text)}", ctx)
        if (key := name.strip().replace("-", "_")) not in names:
            near = get_close_matches(key, names, 3)
            meant = f"; did you mean {', '.join(near)}?" if near else ""
            raise click.UsageError(f"--set: no option named {shortened(name)}{meant}", ctx)
        option, word = names[key]
        if not option.is_flag:
            return option, f"{word}={value}", value
        chosen = click.BOOL.convert(value, option, ctx) == (word in option.opts)
        forms = option.opts if chosen else option.secondary_opts
        if not forms:
            raise click.UsageError(f"--set: {key} can only be switched on; leave it out", ctx)
        return option, forms[-1], chosen

    def _names(self, ctx: click.Context) -> Iterator[tuple[str, tuple[click.Option, str]]]:
        """Names of the options with underscores, each with the word that gives it; those on the command line last."""
        left_out = self._of_help(ctx)
        options = [each for each in self.visible_options(ctx) if each not in left_out and each.name != _SET]
        for option in options:
            yield str(option.name), (option, option.opts[-1])
        for option in options:
            for word in (*option.opts, *option.secondary_opts):
                yield word.lstrip("-").replace("-", "_"), (option, word)

    def _of_help(self, ctx: click.Context) -> list[click.Parameter]:
        """``--help`` and ``--help-all``."""
        own = self.get_help_option(ctx)
        return [each for each in self.get_params(ctx) if each is own or each.name == _HELP_ALL]


command = partial(click.command, cls=Command)


def heading_of(name: str, own: Mapping[str, Iterable[str]]) -> str:
    """Heading of an option by its parameter; what nothing is known of is about the output."""
    for table in (own, _SHARED):
        for heading, names in table.items():
            if name in names:
                return heading
    return _OF_PARTS[PLACE[name]] if name in PLACE else OUTPUT


def in_order(headings: Iterable[str], own: Iterable[str]) -> list[str]:
    """Headings in the order of the help: the robot, the command's own, those of a design, and the output last."""
    last = (OUTPUT, OTHER)
    ranked = ["Robot", *(name for name in own if name not in last), *_OF_PARTS.values(), "Logs", *last]
    return sorted(headings, key=ranked.index)


def _options_of_options() -> list[click.Option]:
    """``--set`` and ``--help-all``."""
    text = "Set any of these options by its name, here or in a task file, such as torque_margin=0.2; repeatable."
    show_all: dict[str, Any] = {"is_flag": True, "is_eager": True, "callback": _show_all}
    return [
        FurtherOption(["--set", _SET], multiple=True, metavar="NAME=VALUE", expose_value=False, help=text),
        FurtherOption(["--help-all"], expose_value=False, help="Show every option and exit.", **show_all),
    ]


def _show_all(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the help with every option and all notes."""
    if wanted and not ctx.resilient_parsing:
        ctx.meta[_HELP_ALL] = True
        click.echo(ctx.get_help(), color=ctx.color)
        ctx.exit()


def _shortened(names: str, text: str, option: click.Option) -> tuple[str, str]:
    """Names and text of an option in the short help: no long lists of names, and the first clause with the default."""
    sentence, gap, default = text.rpartition("  [") if "  [" in text else (text, "", "")
    clause = re.split(r"; |\. ", sentence)[0].rstrip(".")
    return re.sub(r"\[.{25,}\]", "NAME", names), f"{clause}." if option.is_flag else f"{clause}.{gap}{default}"


def _written(ctx: click.Context, paragraph: str) -> str:
    """A paragraph of the notes as the help prints it."""
    formatter = ctx.make_formatter()
    with formatter.indentation():
        formatter.write_text(paragraph)
    return formatter.getvalue()


def _converted(ctx: click.Context, option: click.Option, value: Any) -> Any:
    consumed, _ = option.consume_value(ctx, {str(option.name): value})
    return option.type_cast_value(ctx, consumed)
