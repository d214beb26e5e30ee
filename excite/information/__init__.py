"""Information of a motion on the parameters: information matrix, criteria, prior knowledge, metrics."""
