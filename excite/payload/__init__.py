"""What a robot holds: short motions that show it, and its mass, centre and inertia from their logs."""
