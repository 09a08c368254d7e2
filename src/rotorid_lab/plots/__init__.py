"""Figures of the report's chapters; the style is `rotorid.report.plots.style`."""
