"""Worlds from extracts of OpenStreetMap."""
