"""Echoes of coherent test targets: physical optics over their surface, and the mirrors that show them."""
