"""What a design is asked for."""
