"""The one exception for bad input: a single sentence that says what to mend."""


class InputError(ValueError):
    """Bad input by the user; the message names file, line or column and what was expected."""
