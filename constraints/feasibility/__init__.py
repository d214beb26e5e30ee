"""Why limits contradict each other, and the smallest relaxation that makes a pose feasible."""
