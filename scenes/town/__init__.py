"""Procedural towns: land use, parcels, and what is placed in them."""
