#!/usr/bin/env bash
# One would guess: ARDRegression keeps the features that the data need and drops the others; a thrust that is one
# coefficient times squared rotor speed, with 1 % noise, keeps it.
#
# What happens: by default a coefficient is dropped as soon as its size is below about 0.01, in whatever unit: the
# thrust coefficient of 1e-5 N s2 is 0, and the model predicts no thrust. BayesianRidge finds it; in units of 1e6
# rad2/s2 ARDRegression does, too.
#
# Why it matters: it is used to ask which effects a flight needs. In SI units the answer is decided by the size of
# the unit, and a zero looks like a finding.
#
# Output seen:
#   scikit-learn 1.9.1 numpy 2.4.6
#   BayesianRidge: thrust coefficient 1e-05 N s2
#   ARDRegression: thrust coefficient 0 N s2
#   ARDRegression in units of 1e6: thrust coefficient 1e-05 N s2
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check scikit-learn==1.9.1 numpy==2.4.6 scipy==1.17.1
env/bin/python -W error - <<'END'
from importlib.metadata import version

import numpy as np
from sklearn.linear_model import ARDRegression, BayesianRidge

print("scikit-learn", version("scikit-learn"), "numpy", version("numpy"))
rng = np.random.default_rng(0)
squares = (np.linspace(0, 1000, 200) ** 2)[:, None]
thrust = 1e-5 * squares[:, 0] + 0.05 * rng.standard_normal(200)
found = {}
for name, model, unit in (
    ("BayesianRidge", BayesianRidge, 1.0),
    ("ARDRegression", ARDRegression, 1.0),
    ("ARDRegression in units of 1e6", ARDRegression, 1e6),
):
    found[name] = model(fit_intercept=False).fit(squares / unit, thrust).coef_[0] / unit
    print(f"{name}: thrust coefficient {found[name]:.3g} N s2")
assert abs(found["BayesianRidge"] / 1e-5 - 1) < 0.01 and abs(found["ARDRegression in units of 1e6"] / 1e-5 - 1) < 0.01
assert found["ARDRegression"] == 0, "the threshold follows the units now"
END
