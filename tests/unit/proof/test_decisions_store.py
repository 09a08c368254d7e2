"""Evidence comes back from its files as it was, and answers stay apart from it."""

import json
from dataclasses import replace

import numpy as np

from rotorid.mismatch.evidence.gram import Evidence, EvidenceTerm, LinearParameter
from rotorid_proof.decisions import truths
from rotorid_proof.decisions.label import Label
from rotorid_proof.decisions.store import SEALED, Kept, key_of, newest, read_all, read_evidence, read_truth, write
from rotorid_proof.plantings.kinds import Ratio, Size, named

LABEL = Label("planted/somewhere/values/mass/large/0", "flight", "somewhere", "values")


def evidence(environments=5, seed=0):
    """Three columns in two channels, the last of them estimated apart."""
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(2, environments, 20, 3)), rng.normal(size=(2, environments, 20))
    gram = np.einsum("cbni,cbnj->cbij", x, x)
    parameter = LinearParameter("k", "N s/m", 0.0, np.inf, 0.01)
    return Evidence(
        terms=(
            EvidenceTerm("mass", "value", "", 1, (0.05,)),
            EvidenceTerm("drag/plain", "effect", "drag", 1, (np.inf,), form="plain", linear=(parameter,)),
            EvidenceTerm(
                "gust/run1/3", "effect", "gust", 1, (np.inf,), "run1", ("run1", 3.0, 4.0), of_reading=((0, 0),)
            ),
        ),
        start={"mass": 0, "drag/plain": 1, "gust/run1/3": 2},
        channels=np.array([2, 7]),
        gram=(gram + gram.swapaxes(-1, -2)) / 2,
        cross=np.einsum("cbni,cbn->cbi", x, y),
        square=(y**2).sum(axis=2),
        blocks=np.full(environments, 5),
        bias_gram=0.1 * np.ones((2, 1, 1)) * np.eye(3),
        bias_cross=np.zeros((2, 3)),
        apart_columns=np.array([2]),
        apart_channels=np.array([7]),
        active=("drag/plain",),
    )


def kept(engine="now"):
    """A set that some code judged."""
    key = key_of(LABEL.name, "source", engine)
    return Kept(LABEL, key, "source", engine, 1.5, 30.0, {"verdict": "explained"}, {"effects": [], "outside": []})


def same(a, b):
    """Whether two values of an evidence are equal, arrays and dataclasses among them."""
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    return a == b


def test_evidence_comes_back_as_it_was(tmp_path):
    whole = evidence()
    write(tmp_path, kept(), whole, {"truths": []})
    back = read_evidence(tmp_path, read_all(tmp_path)[0])
    for name, value in vars(whole).items():
        assert same(value, getattr(back.evidence, name)), name
    assert replace(back, evidence=None) == kept()


def test_a_set_without_evidence_has_none(tmp_path):
    write(tmp_path, kept(), None, {})
    assert read_evidence(tmp_path, read_all(tmp_path)[0]).evidence is None


def test_answers_stand_in_the_sealed_folder_alone(tmp_path):
    write(tmp_path, kept(), None, {"answer": {"expected": ["rotor_drag"]}})
    assert "rotor_drag" not in (tmp_path / f"{kept().stem}.json").read_text()
    assert json.loads((tmp_path / SEALED / f"{kept().stem}.json").read_text()) == read_truth(tmp_path, kept())


def test_of_several_codes_that_of_now_counts(tmp_path):
    for engine in ("now", "later"):
        write(tmp_path, kept(engine), None, {})
    assert [k.engine for k in newest(read_all(tmp_path), "now", tmp_path)] == ["now"]


def test_a_truth_comes_back_as_it_was():
    sizes = ((Size("com_offset", "x", 0.01),), (Size("payload", "m", 0.1, added=False),))
    truth = named("com_offset", fair=("payload",), sizes=sizes, ratio=Ratio({"mass_kg": -1.0}, 0.2), unseen="blind")
    assert truths.from_json(json.loads(json.dumps(truths.as_json(truth)))) == truth
