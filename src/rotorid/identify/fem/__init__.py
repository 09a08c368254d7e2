"""Finite elements of the load-cell bench (thesis 2.5).

- `sizes` reads what is printed and what is assumed, `placement` puts the cells where the thesis's equations have them.
- `tets`, `cell` and `bench` make the meshes, `elasticity` solves, `model` is the problem.
- `gauges` give the strain of a cell's bridge, `answers` says what a solved bench does, `statements` holds the thesis's
  four sentences to it.
- `studies` has the chapter's tables, the way from strain to the converter's counts, and the checks of the solver.
"""
