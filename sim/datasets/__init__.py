"""Scans as data: polar scans, folders in published layouts, Cartesian images, poses; loads no ray tracer."""
