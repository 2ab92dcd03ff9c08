"""Settings of a simulation: artefact strengths, surfaces, ray tracing."""
