"""Constants, angles, decibels, Fourier transforms and memory settings."""
