"""The proof: verdicts on recordings with something hidden in them, scored; beside other methods and real recordings."""
