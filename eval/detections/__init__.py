"""Detectors on polar scans, judged by the truth of every cell."""
