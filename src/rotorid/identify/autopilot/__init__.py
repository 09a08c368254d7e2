"""Parameters of autopilots from a flight: thrust curve, hover, drag and lag, each with its 95 % interval."""
