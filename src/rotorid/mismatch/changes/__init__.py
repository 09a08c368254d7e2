"""What changed between sets of one vehicle: what differs first (`level_one`), then which change explains it."""
