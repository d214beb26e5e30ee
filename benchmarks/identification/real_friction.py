"""Friction of joint 2 of a real UR10e, from the log in which it moves alone, used to identify and to verify.

The logs lie in the folder given as the argument (see this folder's README). The rigid part that is subtracted from the
torques is the one identified on the exciting motion; the verification motion is used for nothing but to judge.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import real_ur10e as real
import record

from excite.friction.constant_speed_windows import FitSettings
from excite.friction.friction_fit import Characteristic, characteristics
from excite.friction.points import identified_model
from excite.identification.identification import Identification
from excite.identification.procedure import estimate_parameters
from excite.identification.recipe import Recipe
from excite.logs.log import Log
from excite.logs.log_reading import read_log
from excite.logs.mapping import read_mapping
from excite.verification.verify import verify
from excite.views.figures import write_figure_files
from excite.views.friction_plots import friction_figure
from regressors.robot.friction.curve import CoulombViscous, FrictionCurve
from regressors.robot.friction.curves import FrictionCurves

JOINT = "shoulder_lift_joint"
RUNS = "ur-20_01_22-joint_2.csv"
TRAINING, TEST = "30sec_12harm", "ptp_10_points"
SETTINGS = {
    "chosen": FitSettings(),
    "whatever it carries": FitSettings(load="none"),
    "table": FitSettings(model="table"),
}


def main(folder: Path) -> None:
    """Fit, use and judge; write the results."""
    load_before = record.load()
    mapping = read_mapping(real.HERE / "ur10e.yaml")
    training, test = (read_log(folder / real.FILES[name], None, mapping) for name in (TRAINING, TEST))
    together = identification(training, None)
    rigid = identified_model(real.stored(together), real.ROBOT)
    runs = read_log(folder / RUNS, None, mapping)
    fits = {
        name: characteristics(real.ROBOT, [runs], settings, lambda _: rigid, (JOINT,))[0]
        for name, settings in SETTINGS.items()
    }
    others = curves_of(together)
    rows = [judged("all at once", training, None, test), judged("all at once, then fixed", training, others, test)]
    rows += [
        judged(f"joint 2 from its log, {name}: {name_of(one)}", training, {**others, JOINT: one.curve}, test)
        for name, one in fits.items()
    ]
    content = {
        "fits": {name: described(one) for name, one in fits.items()},
        "identified": {name: vars(curve) for name, curve in others.items()},
        "verification": rows,
    }
    write_figure_files(lambda: {"real_friction": friction_figure("UR10e", [fits["chosen"]])}, real.HERE / "results")
    record.save("real_friction", load_before, content, text(fits, others, rows), LIMITATIONS, folder=real.HERE)


def identification(log: Log, friction: dict[str, FrictionCurve] | None) -> Identification:
    """With the tool's defaults; friction known beforehand, or not."""
    curves = None if friction is None else FrictionCurves(friction)
    return estimate_parameters(real.ROBOT, real.TASK, [log], Recipe(), friction=curves)


def curves_of(result: Identification) -> dict[str, FrictionCurve]:
    """Friction of every joint as it was identified with everything else."""
    known = dict(zip(result.estimate.names, result.estimate.coefficients.tolist(), strict=True))
    return {
        name: CoulombViscous(known[f"F{k}c"], known[f"F{k}v"], known[f"F{k}o"])
        for k, name in enumerate(real.ROBOT.joint_names, 1)
    }


def judged(name: str, training: Log, friction: dict[str, FrictionCurve] | None, test: Log) -> dict[str, Any]:
    """Errors on the test motion after identification on the training one."""
    result = real.stored(identification(training, friction))
    if friction is not None:
        result = real.replace(result, friction=FrictionCurves(friction))
    found = verify(result, test, rows=real.ROWS)
    return {
        "name": name,
        "error_percent": 100 * found.relative_error,
        "joints_percent": [100 * torque.relative for torque in found.torques],
    }


def name_of(one: Characteristic) -> str:
    """Form of the curve."""
    return "table" if one.fit is None else one.fit.form.name


def described(one: Characteristic) -> dict[str, Any]:
    """Parameters with intervals, and what was found."""
    fit = one.fit
    return {
        "model": name_of(one),
        "points": len(one.points),
        "parameters": {} if fit is None else dict(zip(fit.form.parameters, fit.values.tolist(), strict=True)),
        "interval99": [] if fit is None else fit.halfwidth.tolist(),
        "scatter": None if fit is None else fit.scatter,
        "notes": list(one.notes),
    }


def text(fits: dict[str, Characteristic], others: dict[str, FrictionCurve], rows: list[dict[str, Any]]) -> str:
    """The tables."""
    chosen = fits["chosen"]
    assert chosen.fit is not None
    known = others[JOINT]
    found = "; ".join(
        f"{name} {value:.3g} +- {half:.2g}"
        for name, value, half in zip(chosen.fit.form.parameters, chosen.fit.values, chosen.fit.halfwidth, strict=True)
    )
    table = [
        [
            row["name"],
            f"**{row['error_percent']:.2f} %**",
            *(f"{x:.2f} %" for x in row["joints_percent"]),
        ]
        for row in rows
    ]
    return "\n\n".join(
        [
            f"{RUNS}: {'; '.join(chosen.notes)}.",
            f"Chosen by BIC: {name_of(chosen)}: {found} (all at once: coulomb {known.coulomb:.2f}, viscous "
            f"{known.viscous:.2f}, offset {known.offset:.2f}). The points scatter {chosen.fit.scatter:.1f} times as "
            f"much as their noise says, and {fits['whatever it carries'].fit.scatter:.1f} times where friction does "
            "not grow with what the joint carries.",
            f"Relative torque error on {TEST} {real.ROWS} after identification on {TRAINING}:",
            record.table(["friction", "error", *(f"joint {k}" for k in range(1, len(real.ROBOT.joints) + 1))], table),
        ]
    )


LIMITATIONS = (
    "The log is a sine: speed, position and load go together in it, and at its 25 windows of constant speed there is "
    "one speed only; windows of changing speed count, with what acceleration takes subtracted by the identified model.",
    "Windows of one cycle of the sine repeat in the next, so the points are not independent and the intervals are "
    "narrower than they should be.",
    "The rigid part was identified with friction that does not grow with load, and not identified again for the fit.",
    "A table holds speed alone; what the joint carries differs between the log and the test motion.",
)


if __name__ == "__main__":
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit(f"expected one argument: the folder with {RUNS} and the other logs")
    folder = Path(sys.argv[1])
    sys.argv[1] = "FOLDER"  # in the command that the results state
    np.seterr(all="raise", under="ignore")
    main(folder)
