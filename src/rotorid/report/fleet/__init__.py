"""Many recording sets judged together: which vehicles show what, and how it changes with time."""
