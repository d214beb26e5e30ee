"""What repeats of an experiment will show: deviations and biases of the parameters, predicted before it."""
