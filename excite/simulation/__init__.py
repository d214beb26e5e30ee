"""A simulated robot under a tracking controller, and what its sensors would record."""
