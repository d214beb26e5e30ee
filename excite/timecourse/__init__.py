"""Estimates over the growing time of a motion: how soon it determines the parameters, beside other motions."""
