"""Schema numbers of records, and what makes the content of an older file that of today's schema.

A migration takes the content and the arrays of a file of its number, and the folder. It gives the entries of the next
number that are new or of another form, which stand in the place of the old ones, and changes the arrays.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from excite.storage.atomic import read_json
from regressors.errors import InputError

Content = dict[str, Any]
Migration = Callable[[Content, Content, Path], Content]


def schema_of(kind: str) -> str:
    """Schema that is written today, such as ``excite.verification/2``."""
    return f"excite.{kind}/{len(_MIGRATIONS[kind]) + 1}"


def is_of_kind(kind: str, schema: object) -> bool:
    """Whether a schema is one of a kind that can be read."""
    return schema in [f"excite.{kind}/{number}" for number in range(1, len(_MIGRATIONS[kind]) + 2)]


def migrated(kind: str, content: Content, arrays: Content, folder: Path) -> tuple[Content, Content]:
    """Content and arrays in today's schema."""
    number = int(str(content["schema"]).rpartition("/")[2])
    arrays = dict(arrays)
    for migration in _MIGRATIONS[kind][number - 1 :]:
        content = {**content, **migration(content, arrays, folder)}
    return content, arrays


_OUTCOMES = ("DONE", "NOT_POSITIVE", "RAN_AWAY")


def _verification_2(content: Content, arrays: Content, folder: Path) -> Content:
    """Not finite numbers were null, the robot was in the result alone, and curves had names of their own."""
    log, whole = content["log"], content.get("corrected_error")
    corrected = [torque.get("corrected") for torque in content["torques"]]
    motions = content["motions"]
    return {
        "robot": _robot_of_result(folder, content["robot"]["sha256"]),
        "log": {**log, "start": log["from"], "end": log["to"], "left_out": []},
        "relative_error": _infinite(content["relative_error"]),
        "event_free_error": content.get("event_free_error"),
        "horizon": content.get("horizon"),
        "torques": [_entries_infinite(torque) for torque in content["torques"]],
        "corrected": [] if None in corrected else [_entries_infinite(part) for part in corrected],
        "corrected_total": whole and {"noise": "nan", "error": "nan", "relative": whole, "least": "nan"},
        "motions": None if motions is None else [_entries_infinite(motion) for motion in motions],
        **(_verification_arrays(arrays) if arrays else {}),
    }


def _verification_arrays(arrays: Content) -> Content:
    """The entries that refer to the arrays, by the names that these had."""
    simulated = "replay_time" in arrays
    time, q = ("replay_time", "replay_measured") if simulated else ("motion_time", "motion_q")
    entries: Content = {
        **{name: {"array": name} for name in ("time", "measured", "predicted")},
        "motion": {"joints": arrays["joints"].tolist(), "time": {"array": time}, "q": {"array": q}},
        "step": int(arrays["every"]),
    }
    if simulated:
        arrays["replay_dq"] = np.full_like(arrays["replay_q"], np.nan)
        outcome, failed, left_out = arrays["replay_end"].tolist()
        entries["replay"] = {
            "outcome": _OUTCOMES[int(outcome)],
            **{name: {"array": f"replay_{name}"} for name in ("time", "q", "dq")},
            "starts": arrays["replay_starts"].tolist(),
            "stops": arrays["replay_stops"].tolist(),
            "failed_at": failed if np.isfinite(failed) else None,
            "sign_width": "nan",
            "left_out": int(left_out),
        }
    return entries


def _infinite(value: Any) -> Any:
    return "inf" if value is None else value


def _entries_infinite(entry: Mapping[str, Any]) -> Content:
    return {name: _infinite(value) for name, value in entry.items()}


def _robot_of_result(folder: Path, sha256: str) -> Content | None:
    """The robot of the folder's identification, where that is the one that was verified."""
    try:
        robot = read_json(folder / "result.json")["robot"]
    except (InputError, KeyError):
        return None
    return robot if robot.get("sha256") == sha256 else None


def _study_2(content: Content, arrays: Content, folder: Path) -> Content:
    """Curves were lists, with null where they are not finite."""
    courses = []
    for k, course in enumerate(content["courses"]):
        values, deviation, half = (_floats(course[name]) for name in ("values", "deviation", "half_width_99"))
        if values.shape != deviation.shape or values.shape != half.shape:
            raise ValueError("expected a deviation for every value")
        seen = deviation > 0
        curves = {
            "time": _floats(course["time"]),
            "values": values,
            "deviation": np.where(np.isnan(deviation), np.inf, deviation),
            "condition_number": np.nan_to_num(_floats(course["condition_number"]), nan=np.inf),
            "reference": _floats(course["reference"]["values"]),
        }
        if course["scatter"] is not None:
            curves["scatter"] = _floats(course["scatter"])
        arrays |= {f"courses.{k}.{name}": array for name, array in curves.items()}
        courses.append(
            {
                **{name: course[name] for name in ("name", "names", "units", "repetitions", "notes")},
                **{name: {"array": f"courses.{k}.{name}"} for name in curves},
                "quantile": float(np.median(half[seen] / deviation[seen])) if seen.any() else "nan",
                "reference_kind": course["reference"]["kind"],
            }
        )
    return {"robot": content["robot"]["name"], "sha256": content["robot"]["sha256"], "courses": courses}


def _floats(values: Any) -> Any:
    return np.array(values, dtype=float)


def _payload_2(content: Content, arrays: Content, folder: Path) -> Content:
    raise InputError("schema 1 has intervals, but not the covariance that they are from: identify the payload again")


_EXPONENT = re.compile(r"exponent ([\d.]+)")
_NORMAL = 2.5758  # half a 99 % interval over the standard deviation, where the file does not tell


def _friction_fit_2(content: Content, arrays: Content, folder: Path) -> Content:
    """The form of a curve was in its name, covariances were lists, and the curves that were not taken had none."""
    drives = []
    for k, drive in enumerate(content["drives"]):
        fit = drive["fit"]
        drives.append(
            {
                **{name: drive[name] for name in ("unit", "gravity", "points", "stiction", "notes")},
                "drive": drive["name"],
                "rests": drive["points_at_rest"],
                "fit": None if fit is None else _curve_fit_2(fit, f"characteristics.{k}.fit", arrays),
                "others": [],
                "failed": drive["not_fitted"],
            }
        )
    return {
        "robot": content["robot"]["name"],
        "sha256": content["robot"]["sha256"],
        "characteristics": drives,
        "gravity_source": content["subtracted"],
    }


def _curve_fit_2(fit: Content, place: str, arrays: Content) -> Content:
    parameters, name = fit["parameters"], str(fit["model"])
    covariance = _floats(fit["covariance"])
    halves = _floats([each["interval99"] for each in parameters.values()])
    deviations, exponent = np.sqrt(np.diag(covariance)), _EXPONENT.search(name)
    ratio = halves[deviations > 0] / deviations[deviations > 0]
    arrays[f"{place}.values"] = _floats([each["value"] for each in parameters.values()])
    arrays[f"{place}.covariance"] = covariance
    return {
        "form": {
            "name": name,
            "stribeck": "stribeck" in name,
            "asymmetric": name.startswith("asymmetric"),
            "exponent": 1.0 if exponent is None else float(exponent[1]),
            "offset": "offset" in parameters,
            "temperature": fit["reference_temperature"],
            "load": "load" in name.partition(", ")[2],
        },
        **{each: {"array": f"{place}.{each}"} for each in ("values", "covariance")},
        "scatter": fit["scatter"],
        "quantile": float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else _NORMAL,
        "bic": fit["bic"],
        "aicc": _infinite(fit["aicc"]),
        "held": [each for each, value in parameters.items() if value["interval99"] is None],
    }


_MANY = 10**9  # degrees of freedom of Student's t where it is as the normal distribution


def _result_2(content: Content, arrays: Content, folder: Path) -> Content:
    """Parameters were one by one, not finite numbers were null, and curves had names of their own."""
    design = content["design"]
    return {
        **_estimate_of(content),
        **(_result_arrays(arrays) if "every" in arrays else {}),
        "measured_condition_number": _infinite(content["condition_number"]["measured"]),
        "design": design and {**design, "condition_number": _infinite(design["condition_number"])},
        "logs": [_log_of(log) for log in content["logs"]],
        "base": {
            **content.get("base", {"rank": len(content["parameters"]), "columns": [], "gap": None}),
            "gap": _infinite(content.get("base", {}).get("gap")),
            "expressions": [each.get("expression", each["name"]) for each in content["parameters"]],
        },
        "rows": content.get("rows", 0),
        "motor_sides": {
            each["name"]: {name: each["motor_side"][name] for name in ("name", "unit", "factor")}
            for each in content["parameters"]
            if "motor_side" in each
        },
        "relative_error": _infinite(content["relative_error"]),
        "residuals": [_entries_infinite(each) for each in content.get("residuals", ())],
        "noise_density": content.get("noise_density"),
        "reference_values": _reference_of(content),
        "scale": _if_known(_scale_of, content.get("friction_scale")),
        "calibration": _if_known(_calibration_of, content.get("drive_gains")),
        "scatter": _if_known(_scatter_of, content.get("between_logs")),
        "each": any("each" in each for each in (content.get("between_logs") or {}).get("parameters", ())),
        "provenance": content.get("provenance", {}),
    }


def _estimate_of(content: Content) -> Content:
    """The entries of the estimate."""
    parameters, logs = content["parameters"], [log["file"] for log in content["logs"]]
    deviations = [_infinite(each.get("standard_deviation")) for each in parameters]
    free = [each.get("unconstrained") for each in parameters]
    noise, equations = content.get("noise", {}), [name for name, _ in content.get("equations", ())]
    return {
        "method": content["estimator"],
        "names": [each["name"] for each in parameters],
        "units": [each["unit"] for each in parameters],
        "values": [_unknown(each["value"]) for each in parameters],
        "fit": [each["fit"] for each in parameters],
        "unconstrained": None if None in free else free,
        "covariance": _covariance_of(content.get("covariance"), deviations),
        "noise_deviations": [[_unknown(noise.get(log, {}).get(name)) for name in equations] for log in logs],
        "degrees_of_freedom": content.get("degrees_of_freedom", _MANY),
        "unseen": content.get("unseen", []),
        "standard": content.get("standard") or {},
        "mismatch": content.get("friction_mismatch"),
        "notes": content.get("notes", []),
    }


def _covariance_of(rows: Any, deviations: list[Any]) -> list[list[Any]]:
    """A covariance whose parameters that are not identified were null; NaN beside the diagonal where there was none."""
    count = range(len(deviations))
    if rows is None:
        squares = [s if s == "inf" else s**2 for s in deviations]
        return [[squares[j] if j == k else "nan" for k in count] for j in count]
    return [[(_infinite(x) if j == k else x or 0.0) for k, x in enumerate(row)] for j, row in enumerate(rows)]


def _log_of(log: Content) -> Content:
    events = [{**each, "begin": each["from"], "end": each["to"]} for each in log.get("events", ())]
    return {**log, "start": log["from"], "end": log["to"], "events": events}


def _result_arrays(arrays: Content) -> Content:
    """The entries that refer to the arrays, by the names that these had."""
    rows = ("time", "log", "equation", "measured", "predicted", "motion_time", "motion_log", "motion_q")
    of_rows = {name: {"array": name} for name in rows}
    curves = {"step": int(arrays["every"]), "joints": arrays["joints"].tolist(), **of_rows}
    history = [{"array": name} for name in ("history_time", "history")]
    return {"curves": curves, **({"history": history} if "history" in arrays else {})}


def _reference_of(content: Content) -> Content | None:
    kind = content.get("reference")
    values = [_unknown(each.get("reference")) for each in content["parameters"]]
    return None if kind is None else {"kind": kind, "values": values}


def _if_known(convert: Callable[[Content], Content], value: Content | None) -> Content | None:
    return None if value is None else convert(value)


def _scale_of(factors: Content) -> Content:
    """The file had no covariance of the factors: none between them."""
    half = [(each["interval"][1] - each["interval"][0]) / 2 for each in factors.values()]
    covariance = np.diag((np.array(half) / _NORMAL) ** 2).tolist()
    factor = [each["factor"] for each in factors.values()]
    return {"drives": list(factors), "factor": factor, "covariance": covariance, "half_width": half}


def _calibration_of(gains: Content) -> Content:
    drives = gains["drives"].values()
    return {
        **gains,
        "drives": list(gains["drives"]),
        "factor": [each["factor"] for each in drives],
        "deviation": [each["standard_deviation"] for each in drives],
        "half_width": [(each["interval"][1] - each["interval"][0]) / 2 for each in drives],
    }


def _scatter_of(between: Content) -> Content:
    """Estimates of each log were in the file where they were asked for."""
    parameters, logs = between["parameters"], between["logs"]

    def of_logs(name: str, unknown: str) -> list[list[Any]]:
        known = [each.get("each", [{}] * len(logs)) for each in parameters]
        return [[unknown if row[k].get(name) is None else row[k][name] for row in known] for k in range(len(logs))]

    each_log = {
        "logs": logs,
        "names": [each["name"] for each in parameters],
        "units": [each["unit"] for each in parameters],
        "friction": [False] * len(parameters),  # unknown, and of no effect on what is shown
        "values": of_logs("value", "nan"),
        "deviations": of_logs("standard_deviation", "inf"),
        "degrees_of_freedom": ["nan"] * len(logs),
    }
    return {
        "each": each_log,
        "counts": [each["logs"] for each in parameters],
        "means": ["nan"] * len(parameters),
        "ratios": ["nan" if each["ratio"] is None else each["ratio"] ** 2 for each in parameters],
        "probabilities": [_unknown(each["probability"]) for each in parameters],
    }


def _unknown(value: Any) -> Any:
    return "nan" if value is None else value


def _friction_plan_2(content: Content, arrays: Content, folder: Path) -> Content:
    """The schedule stood once, a place had no range beyond its stroke, and null was infinite or not known."""
    schedule = _entries_infinite(content["schedule"])
    return {"trajectories": [_coordinate_2(each, schedule) for each in content["trajectories"]]}


def _coordinate_2(each: Content, schedule: Content) -> Content:
    stroke, ramps = each["stroke"], each["torque_ramps"]
    if ramps is not None:
        steps = round(ramps["duration"] * schedule["rate"])
        ramps = {**_gravity_2(ramps), "steps": steps, "rate": schedule["rate"]}
    return {
        **each,
        **{"low": -stroke, "high": stroke, "below": "", "above": "", "schedule": schedule, "torque_ramps": ramps},
        "largest_gravity": _unknown(each["largest_gravity"]),
        "windows": [_gravity_2(window) for window in each["windows"]],
    }


def _gravity_2(each: Content) -> Content:
    return {**each, "gravity": _unknown(each["gravity"])}


def _posterior_2(content: Content, arrays: Content, folder: Path) -> Content:
    """Names were arrays alone where the values are, and what is not a number was null."""
    listed = ("names", "units", "base_names", "base_units")
    names: Content = {name: arrays[name].tolist() for name in listed if name in arrays}
    floats = {name: _unknown(content[name]) for name in ("prior", "distance", "effective", "split_deviation")}
    references = {name: {"array": name} for name in ("values", "base_matrix")}
    return {**names, **floats, **references}


_NOT_OF_LOGS: Content = {  # how well the motion was followed, and the torques that it took
    **dict.fromkeys(("duration", "work", "loss", "energy_residual"), "nan"),
    **dict.fromkeys(("against", "saturated", "tracking", "torques", "notes"), ()),
    **{name: {} for name in ("settings", "truth")},
    **dict.fromkeys(("samples", "seed"), 0),
}


def _servos_2(content: Content, arrays: Content, folder: Path) -> Content:
    """The limit of torque was of spring and damping together; that of the spring alone is not known from it."""
    values = [[*each[:-1], 1e5] for each in content["values"]]
    half_width = [[*each[:-1], "inf"] for each in content["half_width"]]
    note = "the limits of torque were of another form and are left out: identify again where a servo reaches its limit"
    return {"values": values, "half_width": half_width, "notes": [*content["notes"], note]}


# of each kind, what makes a file of schema 1, 2, ... one of the next; today's number is one more than there are
_MIGRATIONS: dict[str, tuple[Migration, ...]] = {
    "accuracy": (lambda content, *_: {"name": content["design"], "count": content["samples"]},),
    "bound": (lambda content, _, folder: {"name": folder.name, "sensitivity": content.get("sensitivity")},),
    # cells without a design had empty facts
    "campaign": (lambda content, *_: {"rows": [{**row, "facts": row["facts"] or None} for row in content["rows"]]},),
    "cell": (),
    "design": (),
    "friction-fit": (_friction_fit_2,),
    "friction-plan": (_friction_plan_2,),
    "log": (lambda content, *_: {**_NOT_OF_LOGS, **content},),
    "payload": (_payload_2,),
    "posterior": (_posterior_2,),
    # of each period, only what one run brings was in the file
    "precision": (
        lambda content, *_: {"trials": [{**t, "course": [[1, t["use_of_one_run"]]]} for t in content["trials"]]},
    ),
    "result": (_result_2,),
    "servo-verification": (),
    "servos": (_servos_2,),
    "study": (_study_2,),
    "verification": (_verification_2,),
}
