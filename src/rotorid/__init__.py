"""rotorid: from instrument logs to an identified, trustworthy quadrotor model.

Ten lines from a table to a verdict::

    import pandas as pd
    import rotorid

    flight = pd.read_csv("flight.csv")                     # columns of the recording contract
    vehicle = rotorid.template("five-inch", mass_kg=0.71)  # what you believe
    answer = rotorid.verdict(flight, vehicle)
    print(answer.sentence)
    print(answer.effects)                                  # a table: what was left out, by how much
    answer.save("answer")                                  # report.html and its companions
"""

from importlib import import_module

__all__ = [
    "InputError",
    "Result",
    "check",
    "export",
    "parameters",
    "read_log",
    "read_set",
    "simulate",
    "template",
    "verdict",
]

_HOME = {name: "api" for name in __all__} | {
    "InputError": "errors",
    "Result": "report.deliver",
    "read_set": "recordings",
}


def __getattr__(name: str):
    """The public names, each found where it lives when it is first asked for.

    Importing a module of the library runs this file: what the names need must not become part of every rule's code.
    """
    if name not in _HOME:
        raise AttributeError(f"module 'rotorid' has no attribute {name!r}")
    return getattr(import_module("rotorid." + _HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
