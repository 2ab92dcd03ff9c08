"""A page that steps through a data set in the browser."""
