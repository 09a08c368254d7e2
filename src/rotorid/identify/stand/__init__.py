"""The vehicle on the six-axis sensor: clocks, plateaus, mean wrenches, rotor characteristics."""
