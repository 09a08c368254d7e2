"""Controllers and their references, one file each."""
