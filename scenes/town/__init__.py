"""Procedural towns: land use, city blocks and their parcels, streetscape, and what stands on them."""
