"""Designs as motions that controllers play, identified models as files that simulators load."""
