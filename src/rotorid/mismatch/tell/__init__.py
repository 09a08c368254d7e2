"""What a reader sees: locations, simulation forward, the verdict, its sentences and its ledger."""
