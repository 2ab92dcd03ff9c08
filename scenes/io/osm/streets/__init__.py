"""Streets of an OpenStreetMap extract: cross-sections, the graph of roads, and how they fit."""
