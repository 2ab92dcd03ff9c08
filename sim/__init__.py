"""A scene and a drive become polar scans with their truth."""
