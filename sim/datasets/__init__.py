"""Scans as data: the polar scan, folders of scans in published layouts, Cartesian images, poses. Needs no ray tracer."""
