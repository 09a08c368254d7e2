"""Others' ways to a vehicle that predicts, on the runs and folds that the delivered one is chosen on.

Each learns from the fitted runs what the believed vehicle leaves of force and moment, and is asked for the runs held
out. `ridge` regresses it on a flight's state and controls, no physics (as `rotorid.vehicle.derivatives` defines them);
`pysindy` on their products too, a sparse choice of them (Brunton 2016); `network` is the thesis's black box, 20-20,
sigmoid; `output_error` fits thrust and torque coefficients and inertias to half a second simulated forward (Klein and
Morelli, ch. 6). Numbers are chosen by leaving out whole runs, pieces of five seconds where fewer than three are fitted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize
from sklearn.base import BaseEstimator
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.sizes import fitted_part, segments_of
from rotorid.mismatch.deliver.flown import model_of, squares_of_windows
from rotorid.mismatch.evidence.motion import HIGHEST_CUTOFF_HZ, Segment, analysis_rate_hz
from rotorid.mismatch.evidence.rows import GROUPS, Thinner, residual
from rotorid.recordings import Vehicle
from rotorid.vehicle.derivatives import quantities

PIECE_S = 5.0
MOST_FOLDS = 10
PEERS = ("ridge", "pysindy", "network", "output_error")
"""Names of the methods, in the order of the columns."""


def errors(analysis: Analysis) -> dict[str, float]:
    """Each method's error on the runs held out, over the believed vehicle's; geometric means over channels."""
    segments, vehicle = segments_of(analysis), analysis.believed
    thin = Thinner(segments[0].rate_hz, analysis_rate_hz(analysis.recordings.runs, vehicle, HIGHEST_CUTOFF_HZ)[1])
    x, y, side, groups = rows_of(analysis, segments, thin)
    fitted, held = side > 0, side < 0
    known = np.isfinite(x).mean(axis=0) > 0.5
    known[0] = False  # the constant, which every method has of its own
    x = np.nan_to_num(x[:, known])
    there = [c for c in range(6) if np.isfinite(y[:, c]).all() and np.any(y[held, c])]
    if not there or not known.any():
        return {}
    base = _rms(y[held][:, there])

    def learnt(method: BaseEstimator, grid: dict) -> float:
        folds = GroupKFold(min(MOST_FOLDS, len(np.unique(groups[fitted]))))
        left = []
        for c in there:
            search, size = GridSearchCV(method, grid, scoring="neg_mean_squared_error", cv=folds), y[fitted, c].std()
            if grid:
                search.fit(x[fitted], y[fitted, c] / size, groups=groups[fitted])
            else:
                search = method.fit(x[fitted], y[fitted, c] / size)
            left.append(y[held, c] - size * np.ravel(search.predict(x[held])))
        return _mean(_rms(np.column_stack(left)) / base)

    penalties = len(x) * 10.0 ** np.arange(-4.0, 3.0)
    found = {"ridge": learnt(make_pipeline(StandardScaler(), Ridge()), {"ridge__alpha": penalties})}
    network = MLPRegressor(hidden_layer_sizes=(20, 20), activation="logistic", early_stopping=True, random_state=0)
    found["network"] = learnt(make_pipeline(StandardScaler(), network), {})
    try:
        from pysindy.optimizers import STLSQ
    except ImportError:  # a development dependency
        pass
    else:
        sparse = make_pipeline(StandardScaler(), PolynomialFeatures(2), STLSQ(alpha=1e-3, max_iter=20))
        found["pysindy"] = learnt(sparse, {"stlsq__threshold": [0.02, 0.05, 0.1, 0.2]})
    fitted_values = output_error(segments, vehicle, fitted_part(analysis))
    if fitted_values is not None:
        own = rows_of(analysis, segments, thin, fitted_values)[1]
        found["output_error"] = _mean(_rms(own[held][:, there]) / base)
    return found


def rows_of(analysis: Analysis, segments: list[Segment], thin: Thinner, vehicle: Vehicle | None = None):
    """Quantities (n, 12), what a vehicle (the believed one) leaves of the channels (n, 6), +1 where fitted and -1 where
    held out (n,), and what is left out together (n,)."""
    part, out = fitted_part(analysis), []
    for s in segments:
        times = thin.times(s.motion.time_s)
        left, groups = np.full((len(times), 6), np.nan), residual(s, vehicle or analysis.believed)
        for k, group in enumerate(GROUPS[:2]):
            if group in groups:
                left[:, 3 * k : 3 * k + 3] = thin(groups[group])
        pieces = [f"{s.run}/{int(t // PIECE_S)}" for t in times]
        out.append((thin(quantities(s.motion, analysis.believed)), left, part(s.run, times), np.array(pieces)))
    x, y, side, groups = (np.concatenate(columns) for columns in zip(*out, strict=True))
    runs = np.array([name.rsplit("/", 1)[0] for name in groups])
    return x, y, side, runs if len(np.unique(runs[side > 0])) >= 3 else groups


def output_error(segments: list[Segment], vehicle: Vehicle, part: Callable) -> Vehicle | None:
    """The believed vehicle with coefficients and inertias that half a second simulated forward on the fitted runs asks
    for; None where it cannot be simulated."""
    able = [s for s in segments if s.motion.has(("rotor_speed", "angular_velocity"))]
    if not able:
        return None

    def changed(logs: np.ndarray) -> Vehicle:
        thrust, torque, *j = np.exp(logs)
        own = vehicle.inertia_kg_m2
        inertia = own.model_copy(update={n: getattr(own, n) * f for n, f in zip(("xx", "yy", "zz"), j, strict=True)})
        both = ("thrust_coefficient_n_s2", thrust), ("torque_coefficient_n_m_s2", torque)
        scaled = {
            name: tuple(v * f for v in old) if isinstance(old := getattr(vehicle, name), tuple) else old * f
            for name, f in both
        }
        return vehicle.model_copy(update={**scaled, "inertia_kg_m2": inertia})

    def cost(logs: np.ndarray) -> float:
        if np.abs(logs).max() > 2.0:
            return 1e3
        unit = lambda run, t: np.where(part(run, t) > 0, 0, -1)  # noqa: E731
        sums = squares_of_windows(able, model_of(changed(logs)), unit, 1)
        return float(0.5 * np.log(sums[:, 0, 0] / np.maximum(sums[:, 1, 0], 1.0)).mean())

    simplex = np.vstack([np.zeros(5), 0.1 * np.eye(5)])
    found = minimize(cost, np.zeros(5), method="Nelder-Mead", options={"maxfev": 80, "initial_simplex": simplex})
    return changed(found.x)


def _rms(left: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(left**2, axis=0))


def _mean(ratios: np.ndarray) -> float:
    return round(float(np.exp(np.log(np.maximum(ratios, 1e-9)).mean())), 4)
