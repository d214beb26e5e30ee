"""Draw the rooms of the three packages from their imports.

``.venv/bin/python docs/draw_rooms.py`` writes docs/rooms.svg. Rooms are in the order that the import contracts in
pyproject.toml give them. To the right of them are the arrows that no chain of other arrows replaces, to the left all
others, in grey. The more imports, the thicker the arrow; one that points up is red.
"""

from __future__ import annotations

import argparse
import re
import sys
import tomllib
from collections import Counter
from pathlib import Path

import grimp
import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle
from matplotlib.path import Path as Curve

ROOT = Path(__file__).resolve().parents[1]
STEP, GAP = 0.33, 0.42  # from room to room, and more between packages [inch]
WIDTH, HEIGHT = 1.5, 0.25  # of a box
SIDE = 3.3  # room for the arrows on either side
FILLS = ("#dbe9f6", "#e5f2dc", "#fdeeda")
NEEDED, IMPLIED, UPWARD = "#1f3b57", "#c4c4c4", "#d00000"
STYLE = {
    "svg.hashsalt": "rooms",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
}

Edge = tuple[str, str]


def rooms() -> dict[str, list[str]]:
    """Rooms of each package from top to bottom, as the import contracts order them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    layers: dict[str, list[str]] = {}
    for contract in settings["contracts"]:
        if contract["type"] == "layers":
            for container in contract.get("containers", [""]):
                layers[container] = [room.strip("() ") for layer in contract["layers"] for room in layer.split(":")]

    def below(module: str) -> list[str]:
        if module not in layers:
            return [module]
        return [room for layer in layers[module] for room in below(f"{module}.{layer}")]

    return {package: [room for room in below(package) if _exists(room)] for package in layers[""]}


def _exists(module: str) -> bool:
    place = ROOT.joinpath(*module.split("."))
    return place.is_dir() or place.with_suffix(".py").is_file()


def imports(names: list[str]) -> Counter[Edge]:
    """How many imports there are from one room into another."""
    packages = dict.fromkeys(name.partition(".")[0] for name in names)
    graph = grimp.build_graph(*packages, exclude_type_checking_imports=True, cache_dir=None)
    counts: Counter[Edge] = Counter()
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            edge = _room_of(module, names), _room_of(imported, names)
            if None not in edge and edge[0] != edge[1]:
                counts[edge] += 1
    return counts


def _room_of(module: str, names: list[str]) -> str | None:
    """The room that a module is in; None for a package's own ``__init__``, which imports when names are used."""
    return next((name for name in names if f"{module}.".startswith(f"{name}.")), None)


def needed(edges: Counter[Edge]) -> set[Edge]:
    """Edges that no chain of others replaces."""
    targets: dict[str, set[str]] = {}
    for source, target in edges:
        targets.setdefault(source, set()).add(target)

    def reached(starts: set[str]) -> set[str]:
        seen: set[str] = set()
        left = list(starts)
        while left:
            name = left.pop()
            if name not in seen:
                seen.add(name)
                left.extend(targets.get(name, ()))
        return seen

    return {(source, target) for source, target in edges if target not in reached(targets[source] - {target})}


def heights(packages: dict[str, list[str]]) -> dict[str, float]:
    """Height of every room's middle, the lowest at about 0 [inch]."""
    places: dict[str, float] = {}
    height = 0.0
    for names in reversed(packages.values()):
        for name in reversed(names):
            places[name] = height
            height += STEP
        height += GAP
    return places


def draw(packages: dict[str, list[str]]) -> Figure:
    """The drawing.

    Parameters
    ----------
    packages : dict
        See `rooms`.
    """
    names = [name for rooms_of_one in packages.values() for name in rooms_of_one]
    place, edges = heights(packages), imports(names)
    nearest = needed(edges)
    top, bottom = place[names[0]] + 0.75, place[names[-1]] - 0.75
    half = WIDTH / 2 + SIDE
    figure = Figure(figsize=(2 * half, top - bottom))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-half, half), ylim=(bottom, top))
    axes.set_axis_off()
    for (package, inside), fill in zip(packages.items(), FILLS, strict=True):
        _draw_package(axes, package, inside, place, fill)
    for edge, count in sorted(edges.items()):
        _draw_arrow(axes, place, edge, count, nearest=edge in nearest)
    _draw_legend(axes, bottom, half)
    return figure


def _draw_package(axes: Axes, package: str, inside: list[str], place: dict[str, float], fill: str) -> None:
    high, low = place[inside[0]] + 0.5, place[inside[-1]] - 0.25
    half = WIDTH / 2 + SIDE - 0.1
    axes.add_patch(Rectangle((-half, low), 2 * half, high - low, facecolor=fill, alpha=0.35, linewidth=0, zorder=0))
    axes.text(0, high - 0.18, package, ha="center", va="center", weight="bold", fontsize=11)
    for name in inside:
        corner = -WIDTH / 2, place[name] - HEIGHT / 2
        box = FancyBboxPatch(
            corner, WIDTH, HEIGHT, boxstyle="round,pad=0,rounding_size=0.05", facecolor=fill, edgecolor="#555555",
            linewidth=0.8, zorder=3, gid=f"room:{name}",
        )  # fmt: skip
        axes.add_patch(box)
        axes.text(0, place[name] - 0.01, name.partition(".")[2], ha="center", va="center", zorder=4)


def _draw_arrow(axes: Axes, place: dict[str, float], edge: Edge, count: int, *, nearest: bool) -> None:
    start, end = (place[name] for name in edge)
    side = 1 if nearest or end > start else -1
    x, start, end = side * WIDTH / 2, start - 0.05, end + 0.04
    reach = side * min(0.25 + 0.55 * abs(start - end) ** 0.8, SIDE * 4 / 3 - 0.3)
    curve = Curve(
        [(x, start), (x + reach, start), (x + reach, end), (x + side * 0.02, end)],
        [Curve.MOVETO, Curve.CURVE4, Curve.CURVE4, Curve.CURVE4],
    )
    colour = UPWARD if end > start else NEEDED if nearest else IMPLIED
    thickness = 0.35 + 0.55 * count**0.5 if side > 0 else 0.15 + 0.3 * count**0.5
    arrow = FancyArrowPatch(
        path=curve, arrowstyle="-|>,head_length=3,head_width=1.5", mutation_scale=1, color=colour, fill=False,
        linewidth=thickness, zorder=2 if nearest else 1, capstyle="butt", clip_on=False,
    )  # fmt: skip
    axes.add_patch(arrow)


def _draw_legend(axes: Axes, bottom: float, half: float) -> None:
    y = bottom + 0.22
    axes.text(half - 0.15, y, "imports that no chain of others replaces", ha="right", color=NEEDED, fontsize=8)
    axes.text(-half + 0.15, y, "all other imports", ha="left", color="#777777", fontsize=8)
    axes.text(0, y, "thicker: more imports", ha="center", color="#333333", fontsize=8)


def main(arguments: list[str]) -> None:
    """Write the drawing to the file that the command line names."""
    parser = argparse.ArgumentParser(description="Draw the rooms of the three packages from their imports.")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "rooms.svg", help="an .svg or .png file")
    out = parser.parse_args(arguments).out
    with mpl.rc_context(STYLE):
        figure = draw(rooms())
        metadata = {"Date": None, "Creator": None} if out.suffix == ".svg" else None
        figure.savefig(out, metadata=metadata, facecolor="white", dpi=110)
    if out.suffix == ".svg":  # a tenth of a point is enough
        text = out.read_text(encoding="utf-8")
        text = re.sub(r"\d+\.\d{2,}", lambda found: f"{float(found[0]):.1f}", text)
        out.write_text(re.sub(r" +$", "", text, flags=re.MULTILINE), encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main(sys.argv[1:])
