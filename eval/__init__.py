"""Predictions become figures, tables and pictures."""
