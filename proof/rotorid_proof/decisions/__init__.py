"""The bench for decisions: evidence of many sets kept once, decisions on it scored in minutes.

A verdict takes 5 to 100 s, nearly all of it before the last decision. So what a decision needs is kept in files
(`store`), once for each set and code; a decision is a function of it (`Decision`), and all are scored by one table.
"""
