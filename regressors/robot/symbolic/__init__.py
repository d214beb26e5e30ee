"""Kinematics and bodies as CasADi expressions, evaluated at many instants at once or over intervals."""
