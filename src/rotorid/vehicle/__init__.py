"""Vehicles in motion: rigid body, rotors, mixing, integration, simulation in windows."""
