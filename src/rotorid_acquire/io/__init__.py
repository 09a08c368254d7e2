"""Raw logs of instruments: frames, lines, sessions, and the tables that are read back from them."""
