"""Universal constants (CODATA 2018, exact in the SI of 2019)."""

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light in vacuum [m/s]."""
BOLTZMANN = 1.380649e-23
"""Boltzmann constant [J/K]."""
VACUUM_PERMITTIVITY = 8.8541878128e-12
"""Permittivity of vacuum [F/m]."""
STANDARD_TEMPERATURE = 290.0
"""Reference temperature of noise figures (IEEE) [K]."""
