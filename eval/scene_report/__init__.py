"""What a scene holds: plan, counts, statistics."""
