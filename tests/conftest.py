"""One thread for linear algebra, a guard that ends a test which reads the tree's outputs, no record of the user."""

import os
from collections.abc import Generator

import pytest

# As Snakemake's jobs have it. Before numpy is imported: threads that wait for each other spin, which
# on small matrices costs several times what they compute.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from tests.tree import GUARD  # noqa: E402

GUARD.stand()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator:
    """Watch the import of a test module; pytest itself may look at what it passes over."""
    if not isinstance(collector, pytest.Module):
        return (yield)
    with GUARD.watching(collector.path):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator:
    """Watch a test and its fixtures."""
    with GUARD.watching(item.path):
        return (yield)


@pytest.fixture(autouse=True)
def no_record_of_the_user(monkeypatch, tmp_path_factory) -> None:
    """Commands run by a test neither read nor write the user's record of earlier runs."""
    monkeypatch.setattr("rotorid.cli.console.record_file", lambda: tmp_path_factory.getbasetemp() / "waiting.json")
