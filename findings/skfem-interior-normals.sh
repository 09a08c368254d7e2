#!/usr/bin/env bash
# One would guess: on a line of facets inside a mesh, picked by with_boundaries(..., boundaries_only=False), the normal
# of scikit-fem points to one side: the integral of n_x over a unit line is 1 or -1.
#
# What happens: a picked interior set has no side. Each facet's normal points from its first to its second element, by
# their numbers; here half point each way and the integral is 0. facets_around(elements) gives a set with a side, and
# 1.
#
# Why it matters: the force through a section of a load cell's beam, from the stress times the normal, is near zero or
# some fraction, without a warning.
#
# Output seen:
#   scikit-fem 12.0.2 length of the line 1.0
#   integral of n_x: picked set 0.0 oriented set 1.0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check scikit-fem==12.0.2 numpy==2.4.6 scipy==1.17.1
env/bin/python - <<'END'
import numpy as np
import skfem

mesh = skfem.MeshTri().refined(3).with_boundaries({"middle": lambda x: abs(x[0] - 0.5) < 1e-9}, boundaries_only=False)
flow = skfem.Functional(lambda w: w.n[0])
length = skfem.Functional(lambda w: 1.0 + 0 * w.x[0])
picked = skfem.FacetBasis(mesh, skfem.ElementTriP1(), facets="middle")
left = mesh.elements_satisfying(lambda x: x[0] < 0.5)
around = mesh.facets_around(left)
inner = np.isin(around, mesh.boundaries["middle"])
oriented = skfem.generic_utils.OrientedBoundary(np.asarray(around)[inner], around.ori[inner])
turned = skfem.FacetBasis(mesh, skfem.ElementTriP1(), facets=oriented)
print("scikit-fem", skfem.__version__, "length of the line", round(float(length.assemble(picked)), 6))
print(
    "integral of n_x: picked set",
    round(float(flow.assemble(picked)), 6),
    "oriented set",
    round(float(flow.assemble(turned)), 6),
)
assert np.isclose(length.assemble(picked), 1) and np.isclose(abs(flow.assemble(turned)), 1)
assert abs(flow.assemble(picked)) < 0.5, "a picked set has one side now"
END
