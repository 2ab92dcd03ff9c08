"""Detections and motion from the scans of a spinning radar."""
