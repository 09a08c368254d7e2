"""What each locked package is licensed under, as a page of the site, from what the packages themselves state.

python docs/hooks/licences.py            # prints it
"""

from __future__ import annotations

import re
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAD = """# Licences of what rotorid needs

rotorid is under the MIT licence. Below is every package of `requirements.lock`, with the licence that it states itself.
The plain install needs the first table alone; the second serves the workflow, the report, the site and the checks.
`make licences` writes this page alone; `make sbom` writes what is installed as a CycloneDX bill of materials.
"""
WORDS = (
    ("Apache", "Apache-2.0"), ("Mozilla Public", "MPL-2.0"), ("MIT License", "MIT"), ("Redistribution and use", "BSD"),
    ("GNU General Public", "GPL"), ("GNU Lesser General", "LGPL"), ("Permission is hereby granted", "MIT"),
)  # fmt: skip
"""Words of a licence's text by which it is known where the package says nothing else."""
LONGEST = 60


def name_of(text: str) -> str:
    """A package's name as all spell it."""
    return re.sub(r"[-_.]+", "-", text).lower()


def locked() -> dict[str, str]:
    """Names of the locked packages with their versions; where a package has two, the one that is installed here."""
    found: dict[str, list[str]] = {}
    for name, version in re.findall(r"^([A-Za-z0-9_.-]+)==([^ \\;]+)", (ROOT / "requirements.lock").read_text(), re.M):
        found.setdefault(name_of(name), []).append(version)
    return {name: _here(name, versions) for name, versions in found.items()}


def _here(name: str, versions: list[str]) -> str:
    try:
        own = distribution(name).version
    except PackageNotFoundError:
        return versions[0]
    return own if own in versions else versions[0]


def needed() -> set[str]:
    """Names of the packages that the plain install needs, directly or not."""
    found: set[str] = set()
    waiting = ["rotorid"]
    while waiting:
        try:
            asked = distribution(waiting.pop()).requires or []
        except PackageNotFoundError:
            continue
        for line in asked:
            name = name_of(re.match(r"[A-Za-z0-9_.-]+", line)[0])
            if "extra ==" not in line and name not in found:
                found.add(name)
                waiting.append(name)
    return found


def licence_of(name: str) -> str:
    """What a package says of its licence: expression, classifiers, short field, or the words of its file."""
    try:
        package = distribution(name)
    except PackageNotFoundError:
        return "not installed here (another system or Python)"
    stated = package.metadata
    if stated.get("License-Expression"):
        return stated["License-Expression"]
    short = (stated.get("License") or "").strip()
    if short and "\n" not in short and len(short) <= LONGEST and short.lower() != "unknown":
        return short
    classes = [
        line.rsplit(" :: ", 1)[-1] for line in stated.get_all("Classifier", []) if line.startswith("License :: OSI")
    ]
    return " or ".join(classes) or _by_words(short + _file(package)) or "see its files"


def _file(package: Distribution) -> str:
    paths = [p for p in package.files or () if re.search(r"(licen[cs]e|copying)", str(p), re.I)]
    return paths[0].read_text() if paths else ""


def _by_words(text: str) -> str:
    return next((name for words, name in WORDS if words in text), "")


def page() -> str:
    """The page's markdown."""
    plain, versions = needed(), locked()
    parts = [HEAD]
    for title, names in (
        ("The plain install", [n for n in versions if n in plain]),
        ("Everything else", [n for n in versions if n not in plain]),
    ):
        rows = [f"| {n} | {versions[n]} | {licence_of(n).replace('|', ' ')} |" for n in sorted(names)]
        parts.append("\n".join([f"## {title}\n", "| package | version | licence |", "| --- | --- | --- |", *rows, ""]))
    return "\n".join(parts)


if __name__ == "__main__":
    print(page())
