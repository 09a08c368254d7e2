"""What is taken home: which vehicle, and which findings go into which file.

`parts` sorts findings into vehicle, conditions and instruments; `derivatives` fits what is predictable and has no name;
`flown` flies vehicles in windows of the recording; `candidates` chooses one by one number; `usable` asks whether a
vehicle is a body that hovers and flies; `files` writes and reads the three files.
"""
