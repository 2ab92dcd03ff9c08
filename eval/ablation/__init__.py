"""The effect of each artefact on one scan."""
