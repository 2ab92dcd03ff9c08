"""Other road users: vehicles in the lanes and pedestrians on the pavements."""
