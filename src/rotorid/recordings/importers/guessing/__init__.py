"""What the columns of a table are, proposed from names and numbers; see `guess`."""
