"""Check the finite-element solver.

- A cantilever against beam theory and a plate with a round hole against Kirsch, on three meshes each.
"""

from rotorid_lab import log
from rotorid_lab.fem import studies


def main(out: str) -> None:
    """Write a quantity and mesh a row to `out` (CSV)."""
    studies.verification().to_csv(out, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(out=snakemake.output.verification)
