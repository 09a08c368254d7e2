"""The runs held out of a stand or bench, opened once: what a model that was chosen without them makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.mismatch.instrument.chain import ChainResult, moved
from rotorid.mismatch.instrument.columns import rows_of
from rotorid.mismatch.instrument.model import ReadingModel, whole_reading
from rotorid.mismatch.instrument.setup import with_unseen
from rotorid.mismatch.plant.rows import Rows
from rotorid.recordings import RecordingSet


def on_every_run(model: ReadingModel, chain: ChainResult | None, unseen: RecordingSet) -> ReadingModel:
    """The model with the rows of every run: those fitted as they were, those held out by the same equations.

    Where only commands are known, `chain` says how the rotors turn.
    """
    setup = with_unseen(model.setup, unseen)
    own = setup.loadings[len(model.setup.loadings) :]
    if chain is not None and not all(x.measured for x in setup.loadings):
        own = moved(replace(setup, loadings=own), chain)
    kept = [t for t in model.terms if t.kind != "effect" or t.key in model.selection.active]
    cols, width = model.regression.columns([t.key for t in kept]), model.rows[0].x.shape[2]
    rows = []
    for part in rows_of(model.setup, kept, own, whole_reading(model.terms, model.selection.active)):
        x = np.zeros((*part.y.shape, width))
        x[:, :, cols] = part.x
        rows.append(Rows(part.run, part.time_s, part.y, x))
    return replace(model, setup=setup, loadings=(*model.loadings, *own), rows=[*model.rows, *rows])
