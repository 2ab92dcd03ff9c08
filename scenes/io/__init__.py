"""Custom scenes, drives and targets read from files, and scenes written to glTF."""
