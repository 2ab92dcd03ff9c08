"""Street networks: layout, junctions, lanes, and the ground they lie on."""
