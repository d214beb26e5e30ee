"""The built-in kinds of limits beside those of joints, drives and distances, one file each."""
