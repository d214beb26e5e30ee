"""Links that capsules cannot keep apart: the ranges of joints that do, and the distances of the meshes within them.

For the chains of example-robot-data whose meshes are there, the pairs of links two joints apart whose capsules touch in
most poses. coal, which shares no code with the search for ranges, measures the least distance of the meshes themselves
in random poses within the ranges, a fifth of them at their ends.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import coal
import numpy as np
import record
from scipy.spatial import ConvexHull

import excite
from constraints.clearance import link_poses
from constraints.geometry import World
from constraints.hulls import touching_pairs
from constraints.shapes import Solid, urdf_solids
from constraints.world_file import UrdfShapes
from excite.errors import InputError
from regressors.robot.robot import Robot, finite_ranges

CAPSULES = "their capsules"
CLEARANCE, POSES, JOINTS = 0.001, 500, range(4, 10)
HEAD = ("robot", "links", "kept within", "of its range", "least distance of the meshes [mm]", "CPU s")
LIMITATIONS = (
    "descriptions of one collection; ranges are for the description's own limits of positions",
    "distances in random poses may miss a nearer one; the ranges are proven for all poses, of the shapes in the file",
)


def files() -> Iterator[Path]:
    """Descriptions of the collection."""
    folder = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))
    yield from sorted(folder.rglob("*.urdf"))


def mesh(solid: Solid) -> coal.CollisionGeometry:
    """Triangles; of a box or a prism, those of its hull; a sphere."""
    facets, radius = solid
    if facets.shape[1] == 1:
        return coal.Sphere(radius)
    triangles = facets if facets.shape[1] == 3 else facets[0][ConvexHull(facets[0]).simplices]
    made, corners = coal.BVHModelOBBRSS(), triangles.reshape(-1, 3)
    made.beginModel(len(triangles), len(corners))
    made.addVertices(corners)
    made.addTriangles(np.arange(len(corners)).reshape(-1, 3))
    made.endModel()
    return made


def least_distance(
    robot: Robot, within: tuple[tuple[str, float, float], ...], a: list[Any], b: list[Any], links: Any
) -> float:
    """Of the meshes of two links in random poses within ranges [m]."""
    rng = np.random.default_rng(0)
    q = rng.uniform(*finite_ranges(robot), (POSES, robot.n))
    for name, low, high in within:
        ends = [low, high] * (POSES // 10)
        q[:, robot.joint_names.index(name)] = rng.permutation([*rng.uniform(low, high, POSES - len(ends)), *ends])
    poses, still = link_poses(robot, q), coal.Transform3s()
    request, least = coal.DistanceRequest(), np.inf
    for pose in np.linalg.inv(poses[links[0]]) @ poses[links[1]]:
        place = coal.Transform3s(pose[:3, :3], pose[:3, 3])
        for one in a:
            least = min(
                least, *(coal.distance(one, still, other, place, request, coal.DistanceResult()) for other in b)
            )
    return float(least)


def pairs_of(path: Path) -> list[list[object]]:
    """One line for each pair of a description."""
    robot, shapes = excite.load_robot(str(path)), UrdfShapes(str(path))
    parts, left_out = shapes.capsules()
    if robot.n not in JOINTS or left_out or not parts:
        return []
    touching = touching_pairs(robot, parts, CLEARANCE)
    begun = time.process_time()
    found = {each.links: each.within for each in shapes.ranges_apart(World(parts, clearance=CLEARANCE)).apart}
    took = time.process_time() - begun
    solids = urdf_solids(path, shapes._links()[1], {link for pair in touching for link in pair})
    low, high = finite_ranges(robot)
    lines: list[list[object]] = []
    for pair in touching:
        line, place = [path.stem, " to ".join(pair[::-1])], [f"{took / len(touching):.1f}"]
        if pair not in found:
            lines.append([*line, "none" if touching[pair] > 0.5 else CAPSULES, "-", "-", *place])
            continue
        name, lower, upper = min(found[pair], key=lambda each: (each[2] - each[1]) / np.ptp(_own(robot, each[0])))
        share = (upper - lower) / (high - low)[robot.joint_names.index(name)]
        a, b = ([mesh(solid) for solid in solids[link]] for link in pair)
        nearest = 1e3 * least_distance(robot, found[pair], a, b, pair)
        kept = "all" if share > 1 - 1e-9 else f"{name} from {np.degrees(lower):.0f} to {np.degrees(upper):.0f} degrees"
        lines.append([*line, kept, f"{share:.0%}", f"{nearest:.1f}", *place])
    return lines


def _own(robot: Robot, name: str) -> np.ndarray:
    return np.array([ends[robot.joint_names.index(name)] for ends in finite_ranges(robot)])


def main() -> None:
    """Search, measure, and write the page."""
    before, lines, seen = record.load(), [], set()
    for path in files():
        try:
            own = pairs_of(path)
        except (InputError, OSError):
            continue
        fresh = [line for line in own if (key := tuple(line[1:4])) not in seen and not seen.add(key)]
        lines += fresh
        for line in fresh:
            print(*line, sep="; ", flush=True)
    whole, capsules, none = (sum(line[2] == how for line in lines) for how in ("all", CAPSULES, "none"))
    text = (
        f"Of {len(lines)} pairs of links whose capsules touch in more than a quarter of all poses {whole} are apart in "
        f"every pose, {len(lines) - whole - capsules - none} in a narrower range of a joint, {capsules} are left to "
        f"their capsules, which touch in fewer than half, and {none} are not kept apart.\n\n{record.table(HEAD, lines)}"
    )
    record.save("hulls", before, {"pairs": lines}, text, LIMITATIONS)


if __name__ == "__main__":
    main()
