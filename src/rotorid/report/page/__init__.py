"""The page of a verdict: one file that needs no network."""
