"""YAML files that fill a pydantic model: read with limits, faults reported in one sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_YAML, MOST_YAML_VALUES, read_yaml
from rotorid.io.text.wording import explain

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite number: no text, no `true`."""
Whole = Annotated[int, Field(strict=True)]

_Model = TypeVar("_Model", bound=BaseModel)


class KnownKeys(BaseModel):
    """A part of a file that has these keys and no others: what is misspelled is reported, not passed over."""

    model_config = ConfigDict(extra="forbid")


def read_model(
    path: Path,
    model: type[_Model],
    most_bytes: int = LARGEST_YAML,
    most_values: int = MOST_YAML_VALUES,
    compiled: bool = False,
) -> _Model:
    """The model that a file fills. Raises InputError with one sentence that names file and key.

    `compiled` reads by libyaml, ten times faster, where a program wrote the file and will read thousands of them.
    """
    try:
        return model.model_validate(read_yaml(path, False, most_bytes, most_values, compiled))
    except ValidationError as fault:
        raise InputError(f"{path}: {explain(fault, model)}") from None
