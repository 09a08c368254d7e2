"""Plantings: something exact put into real flights, so that naming is measured on real data.

A planting changes the columns of a recorded set, or what is believed about its vehicle, in a way that is exact whatever
else the flight holds. Its verdict is scored against the verdict on the same flight untouched, so that the unknown
physics of the flight cancels.
"""
