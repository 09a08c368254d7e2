"""Results as JUnit XML, which every CI shows: a suite of cases, each passed or failed with its sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape, quoteattr

from rotorid.io.text.wording import printable


def as_junit(suite: str, cases: Mapping[str, Sequence[str]], seconds: float) -> str:
    """The XML of one suite: to the name of each case the sentences by which it fails, none where it passed."""
    failed = sum(bool(sentences) for sentences in cases.values())
    counts = f'tests="{len(cases)}" failures="{failed}" errors="0" skipped="0" time="{seconds:.3f}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<testsuites name="rotorid" {counts}>',
        f"  <testsuite name={_attribute(suite)} {counts}>",
    ]
    for name, sentences in cases.items():
        case = f"    <testcase classname={_attribute(f'rotorid.{suite}')} name={_attribute(name)}"
        if not sentences:
            lines.append(f"{case}/>")
            continue
        text = escape("\n".join(map(_plain, sentences)))
        lines += [f"{case}>", f"      <failure message={_attribute(sentences[0])}>{text}</failure>", "    </testcase>"]
    return "\n".join([*lines, "  </testsuite>", "</testsuites>"]) + "\n"


def _plain(text: str) -> str:
    """A text in one line without what XML cannot hold, whatever a log's name is."""
    return printable(text)


def _attribute(text: str) -> str:
    return quoteattr(_plain(text))
