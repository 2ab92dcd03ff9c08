"""Statistics that several evaluations share."""
