"""Finite elements of the load-cell bench (thesis 2.5).

- `sizes` reads what is printed and what is assumed, `placement` puts the cells where the thesis's equations have them.
- `tets`, `cell`, `plate` and `bench` make the meshes, `elasticity` solves; `model` and `single_cell` are the problems.
- `gauges` and `bridge` go from strain to the converter's counts, `answers` says what a solved bench does, `statements`
  holds the thesis's four sentences to it, `closed_forms` checks the solver.
"""
