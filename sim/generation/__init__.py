"""Data sets from a configuration: scene set-up, workers, manifest, domain randomization."""
