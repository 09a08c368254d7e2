"""The next experiment: what to fly so that the causes a verdict left open can be distinguished, and how well it
would."""
