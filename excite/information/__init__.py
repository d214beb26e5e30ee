"""Information of a motion about the parameters: information matrix, criteria, prior knowledge, metrics."""
