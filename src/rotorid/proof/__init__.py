"""The proof: verdicts on concealed recordings scored against the sealed answers, beside peers and real recordings."""
