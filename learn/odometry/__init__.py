"""From a sequence of scans to a trajectory."""
