"""Finite elements of the load-cell bench (thesis 2.5).

- `sizes` reads what is printed and what is assumed, `placement` puts the cells where the thesis's equations have them.
- `tets` makes meshes, `elasticity` solves; `cell` is one load cell with its bridge, `bench` a leg with all that binds
  it.
- `answers` says what a solved bench does and holds the thesis's four sentences to it.
- `studies` has the chapter's tables, the way from strain to the converter's counts, and the checks of the solver.
"""
