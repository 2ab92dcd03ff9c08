"""What stands in the world and who moves. Knows no radar."""
