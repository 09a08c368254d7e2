#!/usr/bin/env bash
# One would guess: python-control's impulse_response of a sampled system is C A^k B, and a realization made of it by
# eigensys_realization is the system again.
#
# What happens: a system with a step of 0.01 s answers a pulse of height 1/dt: all is 100 times as large (with dt=True
# it is not). eigensys_realization takes that as it is and forgets the step: 100 times the gain, dt=True. markov does
# the same with a response, and not with the bare arrays of that response.
#
# Why it matters: the identified gain of an actuator or of a thrust stand is wrong by the sampling rate.
#
# Output seen:
#   control 0.10.2
#   dt=True: C B = 2, first of the pulse 2, static gain 20, of the realization 20 with dt=True, markov of the response 1.88, of its arrays 1.88
#   dt=0.01: C B = 2, first of the pulse 200, static gain 20, of the realization 2000 with dt=True, markov of the response 193, of its arrays 1.93
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check control==0.10.2 numpy==2.4.6 scipy==1.17.1
env/bin/python - <<'END'
import control
import numpy as np

print("control", control.__version__)
rng = np.random.default_rng(0)
for step, factor in ((True, 1), (0.01, 100)):
    system = control.ss([[0.9]], [[1.0]], [[2.0]], [[0.0]], step)
    pulse = control.impulse_response(system, T_num=40)
    model, _ = control.eigensys_realization(pulse, r=1)
    pushed = rng.normal(size=400)
    times = np.arange(400) * (1 if step is True else step)
    answer = control.forced_response(system, T=times, U=pushed)
    whole, bare = control.markov(answer, m=3), control.markov(np.asarray(answer.outputs), pushed, m=3)
    print(
        f"dt={step}: C B = 2, first of the pulse {np.ravel(pulse.outputs)[1]:g}, static gain {system.dcgain():.4g}, "
        f"of the realization {model.dcgain():.4g} with dt={model.dt}, "
        f"markov of the response {np.ravel(whole)[1]:.3g}, of its arrays {np.ravel(bare)[1]:.3g}"
    )
    assert np.isclose(np.ravel(pulse.outputs)[1], 2 * factor)
    assert np.allclose(np.ravel(whole), factor * np.ravel(bare))
    assert np.isclose(model.dcgain(), 20 * factor) and model.dt is True, "the realization is the system again now"
END
