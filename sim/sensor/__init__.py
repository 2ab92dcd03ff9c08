"""Radar sensors: every number with its source, antenna patterns, the link budget."""
