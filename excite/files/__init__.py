"""Files that are written for people and for robot controllers."""
