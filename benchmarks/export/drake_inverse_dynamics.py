"""Drake loads what `excite export --format drake` writes: its inverse dynamics against the identified model.

    python benchmarks/export/drake_inverse_dynamics.py [--drake FOLDER] [--states 10000]

Needs Drake (``pip install drake``, or ``pip install --target FOLDER drake``). Bodies, reflected rotor inertia and
damping are compared on random states; Coulomb friction, which Drake's joints do not have, is left out of both.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "builders")]

from identified import predicted, result_of  # noqa: E402

import excite  # noqa: E402
from excite.export.models.nearest_bodies import states_of  # noqa: E402
from excite.identification.prediction import instantaneous_target  # noqa: E402
from regressors.samples import Array, Samples  # noqa: E402

CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("panda", {}),
    ("panda", {"joint_rotors": True}),
    ("ur10e", {}),
    ("ur10e", {"joint_rotors": True}),
    ("iiwa7", {}),
    ("iiwa7", {"joint_rotors": True}),
)


def by_drake(path: Path, joints: tuple[str, ...], samples: Samples) -> Array:
    """Torques by Drake's `CalcInverseDynamics`, with the damping of its joints, shape (N, n)."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import MultibodyForces

    plant = MultibodyPlant(0.0)
    (robot,) = Parser(plant).AddModels(str(path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base", robot))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    found = [plant.GetJointByName(name) for name in joints]
    q, v = ([getattr(joint, f"{kind}_start")() for joint in found] for kind in ("position", "velocity"))
    torques, ddq = np.empty((samples.time.size, len(joints))), np.zeros(plant.num_velocities())
    for i in range(samples.time.size):
        plant.SetPositions(context, _placed(plant.num_positions(), q, samples.q[i]))
        plant.SetVelocities(context, _placed(plant.num_velocities(), v, samples.dq[i]))
        ddq[v] = samples.ddq[i]
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)  # gravity, and damping of joints
        torques[i] = plant.CalcInverseDynamics(context, ddq, forces)[v]
    return torques


def _placed(size: int, places: list[int], values: Array) -> Array:
    whole = np.zeros(size)
    whole[places] = values
    return whole


def without_coulomb(result: Any, samples: Samples) -> Array:
    """Torques of the identified model without the Coulomb friction, shape (N, n)."""
    target = instantaneous_target(result.robot, result.task, result.recipe)
    kinds = [target.base.columns[k].kind for k in target.base.index]
    rigid, friction = predicted(result, samples)
    coulomb = np.array([kind == "coulomb" for kind in kinds])
    W = target.model.instants(samples)[:, target.base.index][:, coulomb]
    return rigid + friction - (W @ result.coefficients[coulomb]).reshape(rigid.shape)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--drake", help="folder that Drake was installed into")
    options.add_argument("--states", type=int, default=10_000)
    given = options.parse_args()
    if given.drake:
        sys.path.append(given.drake)
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, settings) in enumerate(CASES):
            path = Path(folder) / f"{number}.urdf"
            result = result_of(excite.load_robot(name), Path(folder), **settings)
            excite.export_model(result, "drake", path)
            target = instantaneous_target(result.robot, result.task, result.recipe)
            samples = states_of(target, given.states)
            expected = without_coulomb(result, samples)
            found = by_drake(path, target.robot.joint_names, samples)
            error = float(np.abs(found - expected).max() / np.abs(expected).max())
            rotors = "with rotors" if settings else "without rotors"
            print(f"{name:8} {rotors:15} {given.states} states: largest relative difference {error:.1e}")
            worst = max(worst, error)
    return 0 if worst < 1e-9 else 1


if __name__ == "__main__":
    raise SystemExit(main())
