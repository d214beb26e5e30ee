"""Exact extrema of motions over continuous time, proven enclosures, and certificates based on them."""
