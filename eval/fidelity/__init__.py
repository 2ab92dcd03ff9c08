"""Statistics of a folder of scans beside those of real ones."""
