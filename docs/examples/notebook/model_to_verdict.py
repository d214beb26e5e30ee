"""Source of the notebook model_to_verdict.ipynb, which docs/run_notebook.py writes and runs."""

# %% [markdown]
# # From a model to a verdict, step by step
#
# A robot's torques are linear in its parameters, $\tau = Y(q, \dot q, \ddot q)\,\theta$. This notebook looks at what
# that means for the IRp-6: which parameters there are to be found, how a motion decides how well, and how to tell
# whether to believe the result.

# %%
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
