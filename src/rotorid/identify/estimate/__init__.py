"""Grey-box estimators: parameters of the equations of motion from data."""
