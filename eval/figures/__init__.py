"""Figures of scans and towns, and the style that all figures share."""
