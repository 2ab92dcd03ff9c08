"""Elements of an OpenStreetMap extract: the file, tags, projection and polygons."""
