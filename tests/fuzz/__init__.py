"""Binary decoders under bytes that nobody meant: by hypothesis in the quick tests, by coverage as long as one likes."""
