"""How the car that carries the radar drives: its route, lane path, speed profile and clearance."""
