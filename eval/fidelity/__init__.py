"""Statistics of a folder of scans compared with those of real scans."""
