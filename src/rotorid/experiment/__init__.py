"""The next experiment: what to fly so that the causes a verdict left open can be told apart, and how well it would."""
