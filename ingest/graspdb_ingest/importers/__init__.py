"""Importers of public hand-object data sets: a file each, and the one way that all their clips go."""
