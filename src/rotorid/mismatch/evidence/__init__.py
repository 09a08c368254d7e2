"""What was recorded, as rows: stretches on one time grid, channels, columns, noise, and regression on them."""
