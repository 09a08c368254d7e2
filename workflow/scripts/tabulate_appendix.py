"""Tables of the report's appendix: settings, controller, excitation of the experiments, what was read.

- Gains and references of the attitude controller, as the code holds them.
- Amplitudes and frequencies of the experiments on the stand (table A.1 of the thesis).
- Every setting of the stages, versions of the packages asked for, hashes of the lock file and the thesis's tables.
"""

import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rotorid.report import provenance
from rotorid.report.provenance import sha256
from rotorid.vehicle.control import THESIS_GAINS, AttitudeReference, training_reference, validation_reference
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab import log

AXES = ("roll", "pitch", "yaw")


def gains() -> pd.DataFrame:
    """Gains about each axis."""
    return pd.DataFrame(list(zip(AXES, *THESIS_GAINS, strict=True)), columns=["axis", "k_p", "k_i", "k_d"])


def reference_rows(reference: AttitudeReference) -> list[dict]:
    """Range and frequency of each angle of a reference, read off its first ten seconds."""
    time = np.arange(0, 10, 1e-3)
    angles = np.degrees([reference.euler_rad(t) for t in time])
    rows = []
    for k, axis in enumerate(AXES):
        values = angles[:, k]
        turns = np.flatnonzero(np.diff(np.sign(values - values.mean())))
        steady = np.ptp(np.gradient(values, time)) < 1e-6
        rows.append(
            {
                "reference": reference.name,
                "angle": axis,
                "kind": "ramp" if steady else "sine",
                "amplitude_deg": None if steady else np.ptp(values) / 2,
                "frequency_hz": None if steady else (len(turns) - 1) / 2 / (time[turns[-1]] - time[turns[0]]),
                "rate_deg_s": float(np.gradient(values, time).mean()) if steady else None,
                "thrust_n": reference.thrust_n,
            }
        )
    return rows


def experiments() -> pd.DataFrame:
    """Table A.1, experiments of one pattern together: signal, throttles, frequency, tilt."""
    rows = []
    for number, entry in EXPERIMENTS.items():
        rows.append(
            {
                "number": number,
                "dynamics": entry.dynamics,
                "signal": entry.signal,
                **{f"throttle_{k + 1}": 100 * value for k, value in enumerate(entry.maxima)},
                "frequency_hz": entry.frequency_hz,
                "roll_deg": entry.roll_deg,
                "pitch_deg": entry.pitch_deg,
            }
        )
    return pd.DataFrame(rows)


def settings(config: Mapping[str, Any]) -> pd.DataFrame:
    """Settings as rows: key with its section, and value."""
    rows = []
    for section, values in config.items():
        for key, value in values.items():
            if isinstance(value, Mapping):
                rows += [{"setting": f"{section}.{key}.{name}", "value": shown(entry)} for name, entry in value.items()]
            else:
                rows.append({"setting": f"{section}.{key}", "value": shown(value)})
    return pd.DataFrame(rows)


def shown(value: Any) -> str:
    """A setting's value as a reader would write it."""
    return ", ".join(map(shown, value)) if isinstance(value, (list, tuple)) else str(value)


def main(
    config: Mapping[str, Any],
    lock: str,
    project: str,
    read: Sequence[str],
    out: Mapping[str, str],
) -> None:
    """Write the tables (CSV); `read` are the files whose hashes are given."""
    gains().to_csv(out["gains"], index=False)
    references = reference_rows(training_reference()) + reference_rows(validation_reference())
    pd.DataFrame(references).to_csv(out["references"], index=False, float_format="%.4g")
    experiments().to_csv(out["experiments"], index=False)
    settings(config).to_csv(out["settings"], index=False)
    direct = provenance.asked_for(Path(project).read_text(encoding="utf-8"))
    found = provenance.installed_versions(Path(lock).read_text(encoding="utf-8"))
    versions = [("Python", platform.python_version()), *((name, found[name]) for name in direct if name in found)]
    pd.DataFrame(versions, columns=["package", "version"]).to_csv(out["versions"], index=False)
    hashes = [{"file": path, "sha256": sha256(Path(path))[:16]} for path in read]
    pd.DataFrame(hashes).to_csv(out["hashes"], index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            config=dict(snakemake.params.config),
            lock=snakemake.input.lock,
            project=snakemake.input.project,
            read=list(snakemake.input),
            out=dict(snakemake.output.items()),
        )
