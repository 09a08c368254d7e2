"""Columns that hold the readings of the bench and of its reference sensor."""

CELLS = tuple(f"cell_{i}_v" for i in range(1, 7))
FORCES = ("force_x_n", "force_y_n", "force_z_n")
