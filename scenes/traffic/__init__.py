"""Other road users: vehicles, pedestrians, right of way."""
