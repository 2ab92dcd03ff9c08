"""Street networks and motorways: layout, junctions, lanes, and the ground."""
