"""Figures: the only place that imports matplotlib. One module per family, one style for all."""
