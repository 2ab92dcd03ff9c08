"""A self-contained page to step through a data set."""
