"""The fit of a flight: preparation, search, winds and payloads, values, what is left, each effect left out."""
