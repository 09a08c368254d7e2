"""Bad input, refused with one sentence."""

from collections.abc import Callable

import pytest

from rotorid.errors import InputError


def refused(match: str | None, call: Callable, /, *arguments, **options) -> str:
    """The sentence of the `InputError` that the call ends with; the expression `match` fits somewhere in it."""
    with pytest.raises(InputError, match=match) as error:
        call(*arguments, **options)
    return str(error.value)
