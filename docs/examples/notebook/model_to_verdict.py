"""Source of the notebook model_to_verdict.ipynb, which docs/run_notebook.py writes and runs."""

# %% [markdown]
# # From a model to a verdict, step by step
#
# A robot's torques are linear in its parameters, $\tau = Y(q, \dot q, \ddot q)\,\theta$. This notebook looks at what
# that means for the IRp-6: which parameters there are to be found, how a motion decides how well, and how to tell
# whether to believe the result.

# %%
import casadi as ca
import matplotlib.pyplot as plt
import numpy as np

import excite

robot = excite.load_robot("irp6")
model = excite.DifferentialModel(robot)
print(len(model.names), "standard parameters:", *model.names[:10], "...")

# %% [markdown]
# ## What can be found
#
# Not all of them have an effect of their own: only *base parameters*, combinations of them, can be told apart. These
# are the ones of the three axes that move; a design is made for them.

# %%
design = excite.design_trajectory(model, excite.Fourier(period=10, harmonics=5), search=excite.Search(starts=1, seed=0))
for column in design.predicted:
    print(f"{column.name:4} {column.expression}")

# %% [markdown]
# ## What a motion decides
#
# All regressors $Y$ of a motion, stacked, are the matrix $W$. The condition number of $W$ says by how much the worst
# direction in the space of parameters is less excited than the best one. Here are the singular values of the designed
# motion, and of a plain one: a sine in each joint.

# %%
time, amplitude = np.arange(0, 10, 0.01)[:, None], np.array([0.6, 0.5, -0.3])
w = 2 * np.pi / 10 * np.array([1, 2, 3])  # once, twice, three times
derivatives = (np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time), -(w**3) * np.cos(w * time))
sine = excite.Samples(time[:, 0], *(amplitude * each for each in derivatives))
for name, samples, marker in (("designed", design.samples, "o"), ("plain", sine, "s")):
    W = design.target.model.assemble(samples)[:, design.base.index]
    values = np.linalg.svd(W, compute_uv=False)
    print(f"{name:8} cond W = {values[0] / values[-1]:.1f}")
    plt.semilogy(range(1, len(values) + 1), values, marker, label=name)
plt.xlabel("number")
plt.ylabel("singular value of W")
plt.legend()
plt.show()

# %% [markdown]
# ## Within the limits
#
# The motion holds every limit at all times, not only at the samples: the extremes are proven.

# %%
for use in design.limits:
    if "acceleration" not in use.label:
        print(f"{use.label:20} {abs(use.extreme):8.3f} of {abs(use.bound):8.3f} {use.unit}")
print("feasible:", design.feasible)

# %% [markdown]
# ## What is identified
#
# A simulated log stands for the one of a robot: encoders with 4000 counts per revolution of the motor, and noise of
# the torques.

# %%
log = excite.simulate(design, encoder=4000, torque_noise=1.0, seed=1)
result = excite.identify(model, log, design=design)
true, (low, high) = result.reference.values, np.array(result.estimate.interval).T
plt.errorbar(range(len(true)), result.coefficients / true, (high - low) / 2 / abs(true), fmt="o")
plt.axhline(1, color="grey", linewidth=0.8)
plt.xticks(range(len(true)), result.names)
plt.ylabel("estimate and 99 % interval, over the truth")
plt.show()

# %% [markdown]
# ## Whether to believe it
#
# Not by how well it fits its own log, but by the log of another motion.

# %%
other = excite.design_trajectory(model, excite.Fourier(period=10, harmonics=5), search=excite.Search(starts=1, seed=1))
check = excite.verify(result, excite.simulate(other, encoder=4000, torque_noise=1.0, seed=2))
print(check.verdict.text)
print(f"torques: {100 * check.relative_error:.1f} % off, noise included")

# %% [markdown]
# ## From a DataFrame
#
# What a real robot recorded is in a file, or already in memory. A frame of pandas, Polars or PyArrow, or a dict of
# columns as here, stands wherever a log does; its columns have the names that those of a file have. Arrays become a log
# by `excite.Log.from_arrays(time, q, effort, joints=[...])`.


# %%
def frame_of(log):
    """Columns by the names that they have in a file."""
    frame = {"time": log.time}
    for k, joint in enumerate(log.joints):
        frame |= {f"{joint}.position": log.q[:, k], f"{joint}.effort": log.effort[:, k]}
    return frame  # or pandas.DataFrame(frame)


frame = frame_of(log.measured)
unseen = frame_of(excite.simulate(other, encoder=4000, torque_noise=1.0, seed=3).measured)
result = excite.identify(model, frame, design=design)
table = result.table("parameters")  # pandas.DataFrame(table) is a frame of it
for name, value, unit in zip(table["parameter"], table["value"], table["unit"], strict=True):
    print(f"{name:4} {value:8.3f} {unit}")

# %% [markdown]
# A frame is known by its content: what a result is from cannot judge it.

# %%
try:
    excite.verify(result, frame)
except excite.InputError as error:
    print(error)

# %% [markdown]
# The frame of the other motion can. Results show themselves; `table(name)` has the columns of each of their tables.

# %%
excite.verify(result, unseen)

# %% [markdown]
# ## Parts of your own
#
# Model, criterion and limits are objects, so that yours stand where ours do. Here is drag in every joint, beside the
# torques that the model has; the variance of that drag alone, whatever becomes of the other parameters; and a hose that
# lets two joints drift apart by 0.6 rad at most.


# %%
class DragModel(excite.DifferentialModel):
    """Torques, with drag."""

    def __init__(self, robot, terms=None, *, sign_width=0.0):
        super().__init__(robot, terms, sign_width=sign_width)
        self.columns += tuple(excite.Column(f"D{j}", "Nm s^2/rad^2", "drag") for j in robot.joint_names)

    def rows(self, q, dq, ddq):
        """Of one instant, as CasADi expressions, shape (n, p)."""
        return ca.horzcat(super().rows(q, dq, ddq), ca.diag(dq * ca.fabs(dq)))


class VarianceOfDrag(excite.Criterion):
    """Root of the summed variances of some columns."""

    name, stages = "variance-of-drag", (1.0,)

    def __init__(self, columns):
        self.columns = columns  # of M = W'W / N

    def value(self, M):
        """The criterion itself."""
        return float(np.sqrt(np.trace(np.linalg.inv(M)[np.ix_(self.columns, self.columns)])))

    def smooth(self, M, sharpness):
        """What is minimised, and its gradient."""
        inverse, E = np.linalg.inv(M), np.eye(len(M))[:, self.columns]
        trace = np.trace(E.T @ inverse @ E)
        return np.log(trace), -inverse @ E @ E.T @ inverse / trace


class Hose(excite.Limit):
    """A bound on the difference of two joints."""

    def imposed(self, robot, motion):
        """Constraints of the coordinates that move."""
        most, label = np.array([0.6]), ("joint q2 less joint q3",)
        difference = excite.NonlinearConstraint(
            robot.n, lambda q, dq, ddq: q[1] - q[2], -most, most, most, label, ("rad",)
        )
        return (difference.restricted(motion),)


dragged, alone = DragModel(robot), excite.Search(starts=1, seed=0, executor="serial")
plain = excite.design_trajectory(dragged, search=alone)
drag = [k for k, each in enumerate(plain.predicted) if each.name.startswith("D")]
own = excite.design_trajectory(dragged, criterion=VarianceOfDrag(drag), constraints=[Hose()], search=alone)
for name, design in (("plain", plain), ("own", own)):
    apart = abs(design.samples.q[:, 1] - design.samples.q[:, 2]).max()
    deviations = " ".join(f"{design.predicted[k].name} {design.predicted[k].standard_deviation:.3f}" for k in drag)
    print(f"{name:6} deviations {deviations}; joints 2 and 3 up to {apart:.2f} rad apart")
