"""Reading and writing: raw logs, recording sets, importers."""
