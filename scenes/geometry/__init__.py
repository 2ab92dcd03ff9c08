"""Curves and solids from which assets and roads are made."""
