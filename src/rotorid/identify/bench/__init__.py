"""The load-cell bench: calibration, reconstruction of forces, tests."""
