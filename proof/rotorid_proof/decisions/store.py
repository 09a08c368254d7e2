"""Evidence in files: three a set, whole or not at all, named by what made them.

`<set>.<key>.json` holds what the engine says of the set, `<set>.<key>.npz` the arrays of a flight's `Evidence`, and
`sealed/<set>.<key>.json` what is true of it, which scoring alone opens. Nothing is ever overwritten by another code's
evidence: the key is a hash of the set's source and of the code that judged it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rotorid.io.text.writing import all_or_none
from rotorid.mismatch.evidence.gram import Evidence, EvidenceTerm, LinearParameter
from rotorid_proof.decisions.label import Label

SEALED = "sealed"
SYMMETRIC = "gram"
"""The one array of which a half is kept: the products are symmetric."""
ARRAYS = ("channels", "cross", "square", "blocks", "bias_gram", "bias_cross", "apart_columns", "apart_channels")


@dataclass(frozen=True)
class Kept:
    """What is kept of a set without its arrays."""

    label: Label
    key: str
    source: str
    """Hash of what made the set."""
    engine: str
    """Hash of the code that judged it."""
    seconds: float
    """Wall time of the verdict."""
    flown_s: float
    """Recorded time, s."""
    verdict: Mapping[str, Any]
    """`verdict.json`, or `{"failed": reason}`."""
    selection: Mapping[str, Any] | None
    """Effects and values by the fitted runs alone, as a verdict has them; `outside` are those that the regression did
    not decide. None for a stand, a bench or a set on which the engine stopped."""
    evidence: Evidence | None = None
    """Set by `read_evidence`."""

    @property
    def stem(self) -> str:
        """Name of its files."""
        return stem_of(self.label.name, self.key)


def key_of(name: str, source: str, engine: str) -> str:
    """Sixteen hexadecimal digits that stand for a set and the code that judged it."""
    return hashlib.sha256(json.dumps([name, source, engine]).encode()).hexdigest()[:16]


def stem_of(name: str, key: str) -> str:
    """Name of the files of a set."""
    return f"{name.replace('/', '-')}.{key}"


def write(folder: Path, kept: Kept, evidence: Evidence | None, truth: Mapping[str, Any]) -> None:
    """Write the files of a set into `folder`; `truth` goes to the sealed one."""
    facts = {"label": asdict(kept.label)} | {
        name: getattr(kept, name) for name in ("key", "source", "engine", "seconds", "flown_s", "verdict", "selection")
    }
    main, arrays, sealed = (folder / f"{kept.stem}.json", folder / f"{kept.stem}.npz", folder / SEALED)
    with all_or_none(main, arrays, sealed / main.name) as (main_part, arrays_part, sealed_part):
        facts["evidence"] = None if evidence is None else described(evidence)
        main_part.write_text(json.dumps(facts) + "\n", encoding="utf-8")
        with arrays_part.open("wb") as file:
            np.savez_compressed(file, **({} if evidence is None else arrays_of(evidence)))
        sealed_part.write_text(json.dumps(truth) + "\n", encoding="utf-8")


def read_all(folder: Path) -> list[Kept]:
    """Everything kept in a folder, without arrays, by name; several of one name where several codes judged it."""
    return [_read(path) for path in sorted(folder.glob("*.json"))]


def _read(path: Path) -> Kept:
    facts = json.loads(path.read_text(encoding="utf-8"))
    facts.pop("evidence")
    return Kept(label=Label(**facts.pop("label")), **facts)


def newest(kept: Iterable[Kept], engine: str, folder: Path) -> list[Kept]:
    """One of each name: that of the engine of now, else the one written last."""
    found: dict[str, Kept] = {}

    def rank(one: Kept) -> tuple[bool, float]:
        return one.engine == engine, (folder / f"{one.stem}.json").stat().st_mtime

    for one in kept:
        if one.label.name not in found or rank(one) > rank(found[one.label.name]):
            found[one.label.name] = one
    return list(found.values())


def read_evidence(folder: Path, kept: Kept) -> Kept:
    """The same with its evidence, where there is any."""
    facts = json.loads((folder / f"{kept.stem}.json").read_text(encoding="utf-8"))["evidence"]
    if facts is None:
        return kept
    with np.load(folder / f"{kept.stem}.npz", allow_pickle=False) as arrays:
        return replace(kept, evidence=evidence_from(facts, arrays))


def read_truth(folder: Path, kept: Kept) -> dict[str, Any]:
    """What is true of a set. Scoring alone asks."""
    return json.loads((folder / SEALED / f"{kept.stem}.json").read_text(encoding="utf-8"))


def described(evidence: Evidence) -> dict[str, Any]:
    """All of an evidence that is no array."""
    return {
        "terms": [asdict(t) for t in evidence.terms],
        "start": dict(evidence.start),
        "active": list(evidence.active),
    }


def arrays_of(evidence: Evidence) -> dict[str, np.ndarray]:
    """The arrays of an evidence; of the symmetric products the upper half, environments last (zeros compress)."""
    upper = np.triu_indices(evidence.gram.shape[-1])
    half = np.moveaxis(evidence.gram[:, :, upper[0], upper[1]], 1, 2)
    return {SYMMETRIC: half, **{name: getattr(evidence, name) for name in ARRAYS}}


def evidence_from(facts: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Evidence:
    """The evidence of what `described` and `arrays_of` keep."""
    size, half = arrays["cross"].shape[-1], np.moveaxis(arrays[SYMMETRIC], 2, 1)
    upper = np.triu_indices(size)
    gram = np.zeros((*half.shape[:2], size, size))
    gram[..., upper[0], upper[1]] = half
    gram[..., upper[1], upper[0]] = half
    return Evidence(
        terms=tuple(_term(t) for t in facts["terms"]),
        start=facts["start"],
        gram=gram,
        **{name: arrays[name] for name in ARRAYS},
        active=tuple(facts["active"]),
    )


def _term(facts: Mapping[str, Any]) -> EvidenceTerm:
    """A term from its JSON, in which tuples are lists; what an older engine kept and nothing reads is left out."""
    facts = {name: facts[name] for name in EvidenceTerm.__dataclass_fields__ if name in facts}
    lists = {name: tuple(facts[name]) for name in ("prior_sd", "values", "nonlinear", "must_show", "brings")}
    return EvidenceTerm(
        **{
            **facts,
            **lists,
            "window": tuple(facts["window"]) if facts["window"] else None,
            "linear": tuple(LinearParameter(**p) for p in facts["linear"]),
            "of_reading": tuple(tuple(pair) for pair in facts["of_reading"]),
        }
    )
