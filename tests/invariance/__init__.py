"""What must not change a verdict: names, clocks, axes, order, format, and how often a sensor was written down."""
