"""Flights on the multibody engine MuJoCo: loads on cables, sloshing, tethers, wind, ground, motors as machines.

Shares nothing with the other simulators. Frames are those of the contract: MuJoCo's gravity vector points along +z,
so its world is north-east-down and its bodies forward-right-down.
"""
