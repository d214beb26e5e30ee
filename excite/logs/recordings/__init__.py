"""Recordings of other programs: what they hold, and the columns that a mapping names; one file per format."""
