"""What made every cell of a scan."""
