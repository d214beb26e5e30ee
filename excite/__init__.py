"""Exciting trajectories for robot identification: design, files, pictures and the command line."""
