"""The design problems whose points are recorded: robot and options of the task."""

from __future__ import annotations

_LOAD = {"model": "load", "period": 6.4}
_WRENCH = {"noise": (1.0, 1.0, 1.0, 0.1, 0.1, 0.1), "weighted": True}
_TOOL = {"tool_box": ((None, None), (None, None), (0.2, None)), "tool_speed": 1.0}
_PRIOR = {"prior": 0.2, "scale": "prior", "noise": (0.5, 2.0, 1.0), "weighted": True}

PROBLEMS = {
    # linear families, limits that are linear in the motion
    "fourier": ("irp6", {}),
    "quintic, energy": ("irp6", {"trajectory": "fourier-quintic", "model": "energy", "criterion": "frobenius"}),
    "cosine, energy long": (
        "irp6",
        {"trajectory": "cosine", "model": "energy", "window": "long", "criterion": "logdet", "base": "pivoted"},
    ),
    "bspline, prior": ("irp6", {"trajectory": "bspline", "intervals": 11, "criterion": "sigma-min", **_PRIOR}),
    "load integral": ("irp6", {**_LOAD, "model": "load-integral", "criterion": "trace", "base": "orthonormal"}),
    # linear families, other limits too
    "fourier, torque, tool": (
        "panda",
        {"friction": False, "torque_margin": 0.4, "tool_point": (0.0, 0.0, 0.1), "base": "orthonormal", **_TOOL},
    ),
    "bspline, collisions": (
        "arm.urdf",
        {"trajectory": "bspline", "intervals": 9, "order": 5, "acceleration": (6.0,), "world": "world.yaml"},
    ),
    "load, torque": ("irp6", {**_LOAD, **_WRENCH, "torque_margin": 0.3, "criterion": "trace"}),
    "one drive, torque": ("irp6", {"model": "energy", "drives": ("2",), "torque_margin": 0.2, "jerk": (20.0,)}),
    # families that are not linear in x
    "waypoints": ("irp6", {"trajectory": "waypoints", "intervals": 5, "criterion": "trace", "base": "pivoted"}),
    "waypoints, torque, tool": (
        "irp6",
        {"trajectory": "waypoints", "intervals": 5, "torque_margin": 0.3, **_TOOL},
    ),
    "waypoints, collisions": (
        "arm.urdf",
        {
            "trajectory": "waypoints",
            "intervals": 6,
            "friction": False,
            "acceleration": (6.0,),
            "world": "world.yaml",
            "criterion": "logdet",
        },
    ),
    "sines, prior": ("irp6", {"trajectory": "sines", "harmonics": 4, "criterion": "sigma-min", **_PRIOR}),
    "sines, torque, tool": (
        "irp6",
        {"trajectory": "sines", "harmonics": 3, "torque_margin": 0.3, "criterion": "frobenius", **_TOOL},
    ),
}
