"""Why limits contradict each other, and the smallest relaxation that would leave a pose."""
