"""Possible robots that the data of a result allow: samples of the posterior."""
