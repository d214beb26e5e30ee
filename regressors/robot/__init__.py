"""The frozen description of a robot: joints, links, drives, limits, gears, inertias; locked joints."""
