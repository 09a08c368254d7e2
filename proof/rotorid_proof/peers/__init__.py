"""Other methods on the same recordings: same columns, same training runs, same scoring; one file each."""
