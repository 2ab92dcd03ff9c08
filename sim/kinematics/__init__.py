"""When each azimuth is swept, and where the radar and the moving objects are then."""
