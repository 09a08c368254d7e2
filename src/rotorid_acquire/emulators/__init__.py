"""Emulated instruments, each in two halves: physics advanced by a time step, and bytes.

`truth` says what is in there, `physics` what it does, `devices` turn commands into physics, physics into counts and
both into bytes, with the faults of a line, `ports` puts the bytes on pseudo-terminals. Nothing here knows the
recorders, and no recorder knows it.
"""
