"""What a robot is, and how its motion shows its dynamic parameters."""
