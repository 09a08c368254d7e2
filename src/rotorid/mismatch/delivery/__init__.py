"""What is taken home: which findings go into which file, and the gate that a vehicle passes before it is written.

`parts` sorts findings into vehicle, conditions and instruments; `gate` keeps out what makes a channel worse where it
was not fitted; `usable` asks whether the vehicle is a body that hovers and flies; `files` writes and reads the three
files.
"""
