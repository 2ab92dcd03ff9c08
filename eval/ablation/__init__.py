"""One scan with and without each artefact: cases, runs, figures."""
