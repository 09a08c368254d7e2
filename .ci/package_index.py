"""Where packages come from, said to pip and to uv alike: shell lines that `make environment` evaluates.

uv reads no setting of pip and pip none of uv. Behind a mirror the user has set one of them; the other is set here to
what that one knows. What is set for both stays as it is.
"""

from __future__ import annotations

import ast
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

UV_VARIABLES = {
    "index-url": ("UV_DEFAULT_INDEX", "UV_INDEX_URL"),
    "extra-index-url": ("UV_INDEX", "UV_EXTRA_INDEX_URL"),
    "find-links": ("UV_FIND_LINKS",),
    "no-index": ("UV_NO_INDEX",),
    "trusted-host": ("UV_INSECURE_HOST",),
    "cert": ("SSL_CERT_FILE",),
}
"""Variables of uv, the one to set first, by the options of pip that say the same."""
COMMAS = ("UV_FIND_LINKS",)
"""Variables whose values commas part; in all others spaces do."""


def pip_settings(listed: str) -> dict[str, list[str]]:
    """Values of pip's options from what `pip config list` prints.

    A variable of the environment counts before a section `install`, that before `global`.
    """
    found: dict[str, list[str]] = {}
    for section in ("global", "install", ":env:"):
        for line in listed.splitlines():
            key, _, value = line.partition("=")
            if key.startswith(section + "."):
                found[key.removeprefix(section + ".")] = str(ast.literal_eval(value)).split()
    return found


def uv_settings(environment: Mapping[str, str], file: Mapping[str, Any]) -> dict[str, list[str]]:
    """The same of uv, by the names of pip's options, from the environment and the content of a `uv.toml`."""
    found: dict[str, list[str]] = {}
    for index in file.get("index", []):
        found.setdefault("index-url" if index.get("default") else "extra-index-url", []).append(index["url"])
    for option in UV_VARIABLES:
        value = file.get("pip", {}).get(option, file.get(option))
        if isinstance(value, (str, list)):
            found[option] = [value] if isinstance(value, str) else value
    for option, names in UV_VARIABLES.items():
        for name in reversed(names):
            if environment.get(name):
                # An index of uv may have a name: `mirror=https://...`.
                words = environment[name].replace(",", " ") if name in COMMAS else environment[name]
                found[option] = [re.sub(r"^[\w.-]+=(?=\w+://)", "", word) for word in words.split()]
    return found


def to_hand_over(pip: Mapping[str, list[str]], uv: Mapping[str, list[str]]) -> dict[str, str]:
    """Variables to set, so that each of the two knows what only the other does."""
    out = {}
    for option, names in UV_VARIABLES.items():
        if option in pip and option not in uv:
            out[names[0]] = ("," if names[0] in COMMAS else " ").join(pip[option])
        elif option in uv and option not in pip:
            out["PIP_" + option.upper().replace("-", "_")] = " ".join(uv[option])
    if "UV_INDEX" in out:
        # pip takes a version from whichever index has it; the hashes of the lock decide what is taken.
        out["UV_INDEX_STRATEGY"] = "unsafe-best-match"
    return out


def main() -> None:
    """Print the lines."""
    listed = subprocess.run([sys.executable, "-m", "pip", "config", "list"], capture_output=True, text=True, check=True)
    folder = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    path = folder / "uv" / "uv.toml"
    file = tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    for name, value in to_hand_over(pip_settings(listed.stdout), uv_settings(os.environ, file)).items():
        print(f"export {name}={shlex.quote(value)}")


if __name__ == "__main__":
    main()
