"""Texts: files that people write, read with limits; names, sentences and numbers as people read them."""
