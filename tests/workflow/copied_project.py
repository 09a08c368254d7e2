"""A copy of the project that a test may run, edit and break."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

from tests.tree import GUARD

ROOT = Path(__file__).parents[2]
PARTS = (
    "Snakefile", "CITATION.cff", "config.yaml", "requirements.lock", "profiles", "workflow", "src", "proof",
    "notebooks", "raw", "tests/configs", "tests/sealed", "docs/proof",
)  # fmt: skip


def left_out(folder: str, names: Iterable[str]) -> set[str]:
    """What is not copied: compiled modules, and sets that somebody has put under raw."""
    return {name for name in names if name == "__pycache__" or GUARD.output(os.path.join(folder, name))}


class Project:
    """The pipeline in a folder of its own, with the small configuration."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for part in PARTS:
            source, target = ROOT / part, root / part
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_symlink():
                target.symlink_to(os.readlink(source))
            elif source.is_dir():
                shutil.copytree(source, target, ignore=left_out)
            elif source.exists():
                shutil.copy2(source, target)

    def snakemake(self, *arguments: str, succeeds: bool = True) -> str:
        """Run Snakemake on the copy, library included, and return all that it says."""
        command = [sys.executable, "-m", "snakemake", "--cores", "2", *arguments]
        if "--configfile" not in arguments:
            command += ["--configfile", "tests/configs/small.yaml"]
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(self.root / "src"), str(self.root / "proof")]),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        done = subprocess.run(
            command, cwd=self.root, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        assert (done.returncode == 0) == succeeds, done.stdout
        return done.stdout

    def build(self) -> None:
        self.snakemake()

    def would_run(self) -> set[str]:
        """Names of the rules that a run would now execute (targets without work of their own left out)."""
        said = self.snakemake("--dry-run")
        if "Nothing to be done" in said:
            return set()
        table = re.search(r"^job +count\n-+ +-+\n((?:.+\n)+?)total ", said, flags=re.MULTILINE)
        assert table, said
        return {line.split()[0] for line in table[1].splitlines()} - {"all", "report"}

    def results(self) -> dict[str, bytes]:
        """Every result by its path, without logs (an executed notebook is one) and provenance."""
        files = (path for path in (self.root / "results").rglob("*") if path.is_file())
        named = {str(path.relative_to(self.root)): path for path in files}
        return {
            name: path.read_bytes()
            for name, path in sorted(named.items())
            if not name.startswith(("results/logs/", "results/notebooks/")) and name != "results/report/provenance.json"
        }
