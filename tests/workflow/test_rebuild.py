"""What reruns and what does not, on a real build of the small configuration."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from copied_project import Project


@contextmanager
def edited(path: Path, old: str, new: str) -> Iterator[None]:
    """`path` with `old` replaced by `new`, and as it was afterwards, time stamp included."""
    text, stat = path.read_text(encoding="utf-8"), path.stat()
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))


AFTER_CHAPTER = {"render_chapter", "typeset_pdf", "build_html", "record_provenance"}
AFTER_CALIBRATION = {"chapter_loadcell", *AFTER_CHAPTER}


def test_a_second_run_does_nothing(built: Project) -> None:
    assert built.would_run() == set()


@pytest.mark.slow
def test_two_builds_give_the_same_bytes(built: Project, project: Project) -> None:
    project.build()
    first, second = built.results(), project.results()
    assert list(first) == list(second)
    assert [name for name in first if first[name] != second[name]] == []
    assert "results/report/report.pdf" in first


def test_a_comment_in_library_or_script_reruns_nothing(built: Project) -> None:
    library = built.root / "src/rotorid_lab/typeset.py"
    script = built.root / "workflow/scripts/render_chapter.py"
    with edited(library, "import csv\n", "import csv  # rows\n"):
        with edited(script, "def main", "# The one function.\ndef main"):
            assert built.would_run() == set()


def test_a_constant_two_imports_away_reruns_what_uses_it(built: Project) -> None:
    # The script imports bench.loadcell, and that imports errors; so do the scripts of the report's text.
    with edited(built.root / "src/rotorid/errors.py", "class InputError", "LIMIT = 3\n\n\nclass InputError"):
        would = built.would_run()
    assert {"calibrate_load_cells", "render_chapter"} <= would


def test_a_changed_formula_reruns_its_stage_and_what_follows_only(built: Project) -> None:
    with edited(built.root / "src/rotorid_lab/loadcell.py", "a1 = sxy / sxx", "a1 = 2 * sxy / sxx"):
        assert built.would_run() == {"calibrate_load_cells", *AFTER_CALIBRATION}


def test_an_edited_raw_file_reruns_what_hangs_on_it_only(built: Project) -> None:
    with edited(built.root / "raw/thesis/table_2_8.csv", "-0.0829", "-0.0830"):
        # The chapter takes tables 2.6 and 2.7 itself, 2.8 through the calibration.
        assert built.would_run() == {"calibrate_load_cells", *AFTER_CALIBRATION}


def test_a_touched_raw_file_reruns_nothing(built: Project) -> None:
    for path in (built.root / "raw/thesis").glob("*.csv"):
        os.utime(path, (time.time(), time.time()))
    assert built.would_run() == set()


@pytest.mark.slow
def test_a_deleted_result_is_made_again_with_what_hangs_on_it_only(built: Project) -> None:
    page = built.root / "results/report/report.html"
    kept = page.read_bytes()
    page.unlink()
    assert built.would_run() == {"build_html", "record_provenance"}
    built.build()
    assert page.read_bytes() == kept


@pytest.mark.slow
def test_a_deleted_figure_is_drawn_again_and_the_report_made_of_it(built: Project) -> None:
    figure = built.root / "results/report/loadcell/lines.svg"
    kept = figure.read_bytes()
    figure.unlink()
    assert built.would_run() == AFTER_CALIBRATION
    # Put back with the same bytes, only newer, it is as good as never gone.
    figure.write_bytes(kept)
    assert built.would_run() == set()


def test_a_changed_setting_reruns_what_takes_it(built: Project) -> None:
    with edited(built.root / "config.yaml", "subtitle: What was", "subtitle: That which was"):
        assert built.would_run() == {"typeset_pdf", "build_html", "record_provenance"}


def test_another_folder_of_recordings_is_taken_from_the_command_line(built: Project) -> None:
    assert "no such key" not in built.snakemake("--dry-run", "--config", "recordings=elsewhere")


def test_an_unknown_key_stops_before_the_first_job(project: Project) -> None:
    with edited(project.root / "config.yaml", "recordings:", "recording:"):
        said = project.snakemake(succeeds=False)
    assert "config.yaml: recording: no such key is known; did you mean recordings?" in said
    assert "Traceback" not in said
    assert not (project.root / "results").exists()


@pytest.mark.slow
def test_a_chapter_that_is_not_there_is_named(project: Project) -> None:
    with edited(project.root / "tests/configs/small.yaml", "- introduction", "- introducton"):
        said = project.snakemake(succeeds=False)
    assert "report.chapters names introducton, but there is no notebooks/introducton.md" in said


@pytest.mark.slow
def test_a_failing_job_leaves_its_one_sentence_in_its_log(project: Project) -> None:
    with edited(project.root / "notebooks/introduction.md", "## Axes", "{{ nowhere.value }}\n\n## Axes"):
        project.snakemake("results/report/chapters/introduction.md", succeeds=False)
    log = (project.root / "results/logs/render_chapter/introduction.log").read_text()
    assert "Traceback" not in log  # of what the user can mend; a fault of the code leaves one (test_log.py)
    assert "introduction.md, line " in log and "'nowhere' is undefined" in log
