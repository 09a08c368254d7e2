"""Mismatch of instruments (kinds `stand` and `bench`): the same verdict as for flights, from readings and loads."""
