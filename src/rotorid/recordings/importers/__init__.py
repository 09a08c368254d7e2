"""Importers of laboratory formats, each ending in recording sets of the contract."""
