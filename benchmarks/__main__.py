"""Every benchmark of this folder, one after the other, each in a process of its own: python -m benchmarks.

Tables are written next to the scripts; the hour of the mismatch stage is left out (benchmarks/mismatch.py --hour).
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
SCRIPTS = ("simulator", "selection", "importing", "networks", "fem", "mismatch")

if __name__ == "__main__":
    for name in sys.argv[1:] or SCRIPTS:
        print(f"--- {name}", flush=True)
        script, table = HERE / f"{name}.py", HERE / f"{name}.md"
        keeps = "--out" in script.read_text(encoding="utf-8")
        subprocess.run([sys.executable, script, *(["--out", table] if keeps else [])], check=True)
