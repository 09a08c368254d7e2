"""A job's log holds messages, warnings and the traceback, and leaves no trace behind."""

import logging
import warnings
from pathlib import Path

import pytest

from rotorid.errors import InputError
from rotorid_lab import log


def test_messages_and_warnings_are_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "job.log"
    with log.to(path):
        logging.getLogger("rotorid.test").info("read %d rows", 3)
        warnings.warn("two cells are empty", stacklevel=1)
    text = path.read_text()
    assert "INFO rotorid.test: read 3 rows" in text
    assert "two cells are empty" in text
    assert text.endswith("INFO rotorid: done\n")


def test_the_traceback_is_in_the_file_and_the_error_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "job.log"
    with pytest.raises(ZeroDivisionError), log.to(path):
        print(1 / 0)
    text = path.read_text()
    assert "Traceback (most recent call last)" in text
    assert "ZeroDivisionError: division by zero" in text


def test_bad_input_ends_the_process_with_its_sentence_and_no_traceback(tmp_path: Path) -> None:
    path = tmp_path / "job.log"
    with pytest.raises(SystemExit) as end, log.to(path):
        raise InputError("a.csv: column time_s is missing")
    assert str(end.value) == "rotorid: a.csv: column time_s is missing"
    assert "Traceback" not in path.read_text()
    assert log.refusal(path) == "a.csv: column time_s is missing"


@pytest.mark.parametrize("fails", [True, False])
def test_a_fault_and_a_success_are_no_refusal(fails: bool, tmp_path: Path) -> None:
    path = tmp_path / "job.log"
    try:
        with log.to(path):
            if fails:
                raise ZeroDivisionError("ERROR rotorid")
    except ZeroDivisionError:
        pass
    assert log.refusal(path) is None


def test_two_runs_leave_the_same_bytes_and_old_text_goes(tmp_path: Path) -> None:
    texts = []
    for _ in range(2):
        with log.to(tmp_path / "job.log"):
            logging.getLogger("rotorid.test").info("same")
        texts.append((tmp_path / "job.log").read_bytes())
    assert texts[0] == texts[1]


def test_handlers_and_level_come_back(tmp_path: Path) -> None:
    root = logging.getLogger()
    before = list(root.handlers), root.level
    with log.to(tmp_path / "job.log"):
        pass
    assert (list(root.handlers), root.level) == before
