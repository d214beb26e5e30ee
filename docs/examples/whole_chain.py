"""From a robot to parameters and a verdict: design a motion, play it in simulation, identify, verify."""

import excite

robot = excite.load_robot("irp6")  # or a robot YAML, or a URDF
model = excite.DifferentialModel(robot)
design = excite.design_trajectory(
    model,
    excite.Fourier(period=10, harmonics=5),
    criterion="condition",
    constraints=[excite.TorqueLimit(margin=0.2)],
    search=excite.Search(starts=1, seed=0),
)
print(design)

log = excite.simulate(design, noise=1.0, seed=1)  # what the robot would measure; read_log("run.csv") of a real one
other = excite.simulate(design, noise=1.0, seed=2)
result = excite.identify(model, log, design=design)
for k, name in enumerate(result.names):
    print(f"{name:4} {result.coefficients[k]:9.4g} +- {result.estimate.deviation[k]:.2g} {result.units[k]}")

check = excite.verify(result, other)
print(check)
print(check.verdict.text)
