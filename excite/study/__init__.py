"""How uncertain: repetitions, growing time, predicted accuracy, posterior, the shortest experiment.

An `excite.study.experiment.Experiment` holds the true motion and parameters, the noise of the sensors, and how
velocities, equations and estimates are computed; `excite.study.repetitions.repeat_experiment` repeats it with the
same steps as an identification from a log::

    experiment = Experiment(model, base, samples, beta, Noise(effort=0.5, count=1e-5), Butterworth(cutoff=10.0))
    repetitions = repeat_experiment(experiment, 1000, seed=0)
    repetitions.bias, repetitions.deviation, repetitions.predicted_deviation, repetitions.coverage
"""
