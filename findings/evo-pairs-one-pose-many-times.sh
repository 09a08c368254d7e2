#!/usr/bin/env bash
# One would guess: evo pairs the poses of two trajectories one to one: a motion capture of 5 s at 200 Hz and a visual
# odometry of 60 s at 30 Hz have about 150 pairs.
#
# What happens: the one with fewer poses, here the fast one, is walked through, and each pose takes the nearest of the
# other: 630 pairs of 151 slow poses. Times repeat, speeds are divisions by zero, and check() of the result says that
# it is invalid; nobody calls it.
#
# Why it matters: the number of pairs, a standard error of the mean error, and the relative error per frame (0 between
# copies, then a step) are wrong.
#
# Output seen:
#   evo 1.38.1 - 1000 poses in 5 s against 1800 in 60 s
#   630 pairs, of 151 different poses of the slow one (a pose up to 5 times); check(): False
#   both move at 1 m/s along one line; RPE per frame: mean 0.0076 m, max 0.0183 m
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check evo==1.38.1
env/bin/python - <<'END'
import warnings
from importlib.metadata import version
import numpy as np
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D

warnings.simplefilter("ignore")


def along_x(times):
    places, level = np.column_stack([times, 0 * times, 0 * times]), np.tile([1.0, 0, 0, 0], (len(times), 1))
    return PoseTrajectory3D(positions_xyz=places, orientations_quat_wxyz=level, timestamps=times)


fast, slow = along_x(np.arange(1000) / 200 + 10), along_x(np.arange(1800) / 30)
a, b = sync.associate_trajectories(fast, slow, max_diff=0.01)
times, copies = np.unique(b.timestamps, return_counts=True)
valid, details = b.check()
rpe = metrics.RPE(metrics.PoseRelation.translation_part, delta=1, delta_unit=metrics.Unit.frames)
rpe.process_data((a, b))
print("evo", version("evo"), f"- {fast.num_poses} poses in 5 s against {slow.num_poses} in 60 s")
print(
    f"{b.num_poses} pairs, of {len(times)} different poses of the slow one (a pose up to {copies.max()} times); check(): {valid}"
)
mean, most = (rpe.get_statistic(kind) for kind in (metrics.StatisticsType.mean, metrics.StatisticsType.max))
print(f"both move at 1 m/s along one line; RPE per frame: mean {mean:.4f} m, max {most:.4f} m")
assert b.num_poses > 3 * len(times) and copies.max() >= 4 and not valid, "a pose is paired once now"
END
