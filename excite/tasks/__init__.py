"""Design tasks: a robot and the options of a design."""
