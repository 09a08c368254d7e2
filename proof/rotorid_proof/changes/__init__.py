"""The proof of `rotorid compare`: pairs of sets in which it is known what changed, and how they are scored."""
