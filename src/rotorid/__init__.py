"""rotorid: from instrument logs to an identified, trustworthy quadrotor model."""
