"""Robot descriptions read from files: robot YAML and URDF, and the built-in robots by name."""
