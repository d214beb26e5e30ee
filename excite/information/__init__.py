"""What a motion tells of the parameters: information matrix, criteria, prior knowledge, metrics."""
