"""What spoils a log between the robot and the file: clock, recorder, delay, gains, noise that is not white, warmth."""
