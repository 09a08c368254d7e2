"""Finite elements of the load-cell bench (thesis 2.5).

- `placement` reads what is printed and what is assumed, and puts the cells where the thesis's equations have them.
- `elasticity` makes meshes and solves them; `bench` is a load cell with its bridge, a leg with all that binds it, and
  what a solved bench does, with the thesis's four sentences on it.
- `studies` has the chapter's tables, the way from strain to the converter's counts, and the checks of the solver.
"""
