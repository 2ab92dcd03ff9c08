"""Matches and the motion that fits them, in the plane."""
