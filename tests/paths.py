"""Where the project's own files and those beside the checkout lie, seen from any folder of tests."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The checkout."""
SHARED = ROOT.parent / "shared"
"""Real scans and trajectories beside the checkout, which may be absent."""
