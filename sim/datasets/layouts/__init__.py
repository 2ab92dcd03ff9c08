"""Folder layouts of published data sets: Oxford, MulRan, Boreas."""
