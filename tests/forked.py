"""The command line in a process of its own for each call, forked from one that has imported all: that takes seconds."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

SERVER = """
import atexit, json, os, re, signal, sys, traceback
from rotorid.cli import app

def answered(words, said):
    # The child's: what the command says goes to a file, its end is the child's.
    signal.alarm(120)
    file = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    os.dup2(file, 1), os.dup2(file, 2)
    code = 0
    try:
        app(words)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stdout.flush(), sys.stderr.flush()
    return code

answers = sys.stdout
try:
    sys.stdout = open(os.devnull, "w")
    app(json.loads(sys.argv[1]))
except SystemExit:
    sys.stdout = answers
for line in sys.stdin:
    words, said, peak = json.loads(line)
    child = os.fork()
    if not child:
        code = answered(words, said)
        # Of this child alone: it begins at what the parent holds when it forks.
        with open("/proc/self/status") as status, open(peak, "w") as file:
            file.write(re.search(r"VmHWM:\\s+(\\d+)", status.read())[1])
        atexit._run_exitfuncs()  # as at the end of any process: what measures coverage writes it down
        os._exit(code)
    _, status, usage = os.wait4(child, 0)
    answers.write(json.dumps([os.waitstatus_to_exitcode(status), usage.ru_utime]) + chr(10))
    answers.flush()
"""


@dataclass(frozen=True)
class Done:
    """How a command ended: its exit code, all that it said, its user time, s, and its most memory, bytes."""

    code: int
    said: str
    user_s: float
    most_bytes: int


class Commands:
    """Commands, each in a child of one process."""

    def __init__(self, process: subprocess.Popen, folder: Path) -> None:
        self._process, self._folder = process, folder

    def run(self, *words: object) -> Done:
        """Run `rotorid` with these words; killed after two minutes."""
        said, peak = self._folder / "said", self._folder / "peak"
        peak.unlink(missing_ok=True)
        self._process.stdin.write(json.dumps([[str(word) for word in words], str(said), str(peak)]) + "\n")
        self._process.stdin.flush()
        code, user_s = json.loads(self._process.stdout.readline())
        assert peak.exists(), f"killed by signal {-code}: {said.read_text(errors='replace')}"
        return Done(code, said.read_text(), user_s, int(peak.read_text()) * 1024)


@contextmanager
def commands(folder: Path, *first: object) -> Iterator[Commands]:
    """Start the process, which runs a `first` command itself, so that all it needs is imported."""
    words = [sys.executable, "-c", SERVER, json.dumps([str(word) for word in first])]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Commands(process, folder)
        finally:
            process.stdin.close()
