"""Thousands of noisy repetitions of an experiment in one batch, to compare what is predicted with what occurs.

An `excite.montecarlo.experiment.Experiment` holds the true motion and parameters, the noise of the sensors, and how
velocities, equations and estimates are made; `excite.montecarlo.repeated.repeat_experiment` runs it over and over with
the same steps as an identification from a log::

    experiment = Experiment(model, base, samples, beta, Noise(effort=0.5, count=1e-5), Butterworth(cutoff=10.0))
    repetitions = repeat_experiment(experiment, 1000, seed=0)
    found.bias, found.deviation, found.predicted_deviation, found.coverage
"""
