"""Constants, decibels, Fourier transforms and memory settings."""
