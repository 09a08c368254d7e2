"""Flights as one set of differential equations, solved by SciPy's DOP853: hexarotors, micro and heavy quadrotors.

Continuous cascades as in PX4 (position, velocity, attitude, rates), rotors by blade elements and Glauert's inflow,
instruments from motion capture to an autopilot's log with an observer's estimates. Shares nothing with the others.
"""
