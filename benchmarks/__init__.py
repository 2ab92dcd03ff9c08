"""Speed and memory, measured: the same work side by side, medians, on a stated machine."""
