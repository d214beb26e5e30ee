"""Tables of study 2."""

from __future__ import annotations

from typing import Any

import numpy as np
import record

_SHOWN = ("m", "mcz", "Iyy")
_SPREAD = "Iyy"


def text(content: dict[str, Any]) -> str:
    """All tables with what they say."""
    parts = {
        "The load and the sensor": load,
        "Motions": motions,
        "Coverage": coverage,
        "Noise of the measured motion": noisy,
    }
    return "\n\n".join(line for title, part in parts.items() for line in (f"### {title}", *part(content)))


def load(content: dict[str, Any]) -> list[str]:
    """The truth beside what is printed, and the fit of the noise."""
    truth, fits = content["truth"], content["accuracy"]["fits"]
    paper = content["accuracy"]["motions"]["paper's"]["least squares"]
    fit = fits["least squares, white"]
    a, b, c = (1000 * edge for edge in truth["edges"])
    eigenvalues = ", ".join(f"{x:.2g}" for x in truth["eigenvalues_of_printed_pseudo_inertia"])
    head = (
        "parameter",
        "truth",
        "computed, printed",
        "estimated, printed",
        "deviation, printed",
        "ours",
        "printed / ours",
    )
    rows: list[list[object]] = []
    for k, name in enumerate(content["names"]):
        row = [f"{truth['parameters'][k]:.5f}"]
        if k == 0:
            row += ["-", "-", "-", f"{paper[k]:.2g}", "-"]
        else:
            row += [f"{truth['printed'][k]:.5f}", f"{truth['printed_estimates'][k - 1]:.5f}"]
            row += [f"{truth['printed_deviations'][k - 1]:.2g}"]
            row += [f"{paper[k]:.2g}", f"{fit['ratios'][k - 1]:.2f}"]
        rows.append([name, *row])
    fitted = [
        [name, f"{x['force']:.2g}", f"{x['torque']:.2g}", f"{np.exp(x['rms_log']):.2f}", f"{np.exp(x['least']):.2f}",
         f"{min(x['ratios']):.2f}-{max(x['ratios']):.1f}"]
        for name, x in fits.items()
    ]  # fmt: skip
    return [
        f"Truth: a steel cuboid of {a:.0f} x {b:.0f} x {c:.0f} mm, 1.75 kg, with the printed static moments and its "
        "moments of inertia as near to the printed ones as can be. The printed column has a pseudo-inertia with "
        f"eigenvalues {eigenvalues}; what changed most is Ixx, and the paper's own estimate of it agrees with the "
        "cuboid's. Parameters in kg, kg m, kg m^2 about the sensor.",
        record.table(head, rows),
        "Noise that explains the printed deviations best (root mean square of the logarithms), for one motion of the "
        "paper. The first is used below.",
        record.table(("model", "force [N]", "torque [Nm]", "rms factor", "least rms factor", "printed / ours"), fitted),
    ]


def motions(content: dict[str, Any]) -> list[str]:
    """Predicted deviations of every motion."""
    found = content["accuracy"]["motions"]
    paper, *others = found.values()
    ratios = {kind: [np.divide(x[kind], paper[kind]) for x in others] for kind in ("weighted", "least squares")}
    equal = [np.sqrt(x["samples"] / paper["samples"]) for x in others]
    head = ["parameter", "paper's motion", *(f"{name} / paper's" for name in list(found)[1:])]
    head += [f"{name} / paper's, as many samples" for name in list(found)[1:]]
    rows: list[list[object]] = [
        [
            name,
            f"{paper['weighted'][k]:.2e}",
            *(f"{r[k]:.2f}" for r in ratios["weighted"]),
            *(f"{r[k] * e:.2f}" for r, e in zip(ratios["weighted"], equal, strict=True)),
        ]
        for k, name in enumerate(content["names"])
    ]
    rows.append(["largest", "", *_largest(ratios["weighted"], equal)])
    rows.append(["largest, least squares", "", *_largest(ratios["least squares"], equal)])
    conditions = [f"{x['condition_number']:.1f}" for x in found.values()]
    rows.append(["condition number", *conditions, "", ""])
    rows.append(["samples", paper["samples"], *(x["samples"] for x in others), "", ""])
    long = content["designs"][0]
    return [
        "Predicted standard deviations of weighted least squares; `as many samples`: per square root of the number of "
        "samples, which is time. Designs: `excite design irp6 --model load --period 6.4 --rate 250 --seed 0` "
        f"({long['cpu_seconds']:.0f} s of processor time) and the same with 1.832 s.",
        record.table(head, rows),
    ]


def _largest(ratios: list[Any], equal: list[Any]) -> list[str]:
    return [f"**{r.max():.2f}**" for r in ratios] + [f"{r.max() * e:.2f}" for r, e in zip(ratios, equal, strict=True)]


def coverage(content: dict[str, Any]) -> list[str]:
    """How often 99 % intervals hold when only the wrench is noisy."""
    head = ["parameter"]
    for run in content["coverage"]:
        head += [f"{run['name']}: coverage", "spread / predicted"]
    rows: list[list[object]] = [
        [
            name,
            *(
                cell
                for run in content["coverage"]
                for cell in (
                    f"{100 * run['coverage'][k]:.1f} %",
                    f"{run['deviation'][k] / run['predicted_deviation'][k]:.3f}",
                )
            ),
        ]
        for k, name in enumerate(content["names"])
    ]
    cpu = sum(run["cpu_seconds"] for run in content["coverage"])
    return [
        f"{content['repetitions']} repetitions each, noise on the wrench only; {cpu:.0f} s of processor time for all "
        "four. Least squares takes forces and torques to be equally noisy: its intervals are wrong in both directions.",
        record.table(head, rows),
    ]


def noisy(content: dict[str, Any]) -> list[str]:
    """Bias and coverage when positions are noisy too."""
    names, truth = content["names"], np.array(content["truth"]["parameters"])
    head = ["motion", "positions", "motion from", "estimator", "equations"]
    head += [f"bias of {name}" for name in _SHOWN] + [
        f"spread of {_SPREAD}",
        "largest bias / spread",
        "coverage",
        "CPU s",
    ]
    spread = names.index(_SPREAD)
    rows: list[list[object]] = []
    for run in content["noisy_motion"]:
        bias = np.array(run["bias"])
        part = np.abs(bias) / run["deviation"]
        worst = int(np.argmax(part))
        share = 100 * bias / truth
        low, high = 100 * min(run["coverage"]), 100 * max(run["coverage"])
        rows.append(
            [
                *(run[key] for key in ("motion", "position_noise", "way", "estimator")),
                run["rows"],
                *(f"{share[names.index(name)]:.2f} %" for name in _SHOWN),
                f"{100 * run['deviation'][spread] / truth[spread]:.1f} %",
                f"{part[worst]:.2f} ({names[worst]})",
                f"{low:.1f}-{high:.1f} %",
                f"{run['cpu_seconds']:.1f}",
            ]
        )
    return [
        f"{content['repetitions_with_noisy_motion']} repetitions each; `coverage`: lowest and highest of the ten "
        f"parameters, where 99 % is wanted; `equations`: rows of W. All repetitions of this study took "
        f"{content['cpu_seconds_of_repetitions']:.0f} s of processor time. "
        "Figure: `results/load_table1.png`.",
        "![bias and coverage](results/load_table1.png)",
        record.table(head, rows),
    ]
