"""What a robot is, and which of its dynamic parameters its motion identifies."""
