"""Exact extrema of motions over continuous time, proven enclosures, and the certificates made of them."""
