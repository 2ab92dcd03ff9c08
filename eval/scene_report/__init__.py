"""What a scene holds: its plan and its counts."""
