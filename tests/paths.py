"""Paths of the checkout and of the files beside it, for tests in any folder."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The checkout."""
SHARED = ROOT.parent / "shared"
"""Real scans and trajectories beside the checkout, which may be absent."""
