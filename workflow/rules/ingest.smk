"""From raw logs to tidy tables: one table of samples and one of recordings for each kind of test and instrument."""

from rotorid.errors import InputError
from rotorid_acquire.io.session import read_index

INDEX = f"{CONFIG.raw}/sessions.tsv"


def index_rows():
    """Rows of the index of recordings; none where there is no index in the folder."""
    if not Path(CONFIG.raw).is_dir():
        refuse(f"config.yaml: raw is {CONFIG.raw!r}, expected a folder of raw logs that is there")
    if not Path(INDEX).exists() and not Path(INDEX).is_symlink():
        return []
    try:
        return read_index(Path(CONFIG.raw))
    except InputError as error:
        refuse(error)


# The index is read here and is no rule's input: a new row reruns only what its own kind of test feeds.
SESSIONS = index_rows()


def logs_of(kind, instrument):
    """Raw logs of one kind of test and instrument, each with its metadata."""
    rows = [row for row in SESSIONS if (row["kind"], row["instrument"]) == (kind, instrument)]
    return [f"{CONFIG.raw}/{row[name]}" for row in rows for name in ("file", "metadata")]


# So many tests of a rotor make a curve; fewer are as good as none.
LEAST_TESTS = {"thrust": 4, "torque": 4}


def recorded_kinds():
    """Kinds of tests and instruments that the index lists often enough to be used."""
    pairs = [(row["kind"], row["instrument"]) for row in SESSIONS]
    return {pair for pair in pairs if pairs.count(pair) >= LEAST_TESTS.get(pair[0], 1)}


KINDS_RECORDED = recorded_kinds()


def logs_to_ingest(wildcards):
    """Raw logs and metadata behind one pair of tables."""
    found = logs_of(wildcards.kind, wildcards.instrument)
    if not found:
        refuse(
            f"{INDEX}: lists no {wildcards.kind} recording of a {wildcards.instrument}; make campaign records them."
        )
    return found


rule ingest:
    """Raw logs of one kind of test and instrument as tidy tables."""
    message:
        "Ingest: {wildcards.kind}, {wildcards.instrument}"
    input:
        logs=logs_to_ingest,
    output:
        samples="results/ingest/{kind}/{instrument}.parquet",
        recordings="results/ingest/{kind}/{instrument}.csv",
    params:
        code=code_of("ingest"),
    log:
        "results/logs/ingest/{kind}-{instrument}.log",
    wildcard_constraints:
        kind="[a-z]+",
        instrument="[a-z0-9]+",
    script:
        "../scripts/ingest.py"


def ingested(kind, instrument):
    """Samples and recordings of one kind of test and instrument."""
    return [f"results/ingest/{kind}/{instrument}.{suffix}" for suffix in ("parquet", "csv")]


def filter_settings(wildcards):
    """Settings of the filters for one instrument."""
    return getattr(CONFIG.filter, wildcards.instrument).model_dump()


rule prepare_bench:
    """Bench readings tared, freed of spikes, and filtered in two ways."""
    message:
        "Filter: {wildcards.kind}, {wildcards.instrument}"
    input:
        samples="results/ingest/{kind}/{instrument}.parquet",
        recordings="results/ingest/{kind}/{instrument}.csv",
    output:
        prepared="results/filtered/{kind}/{instrument}.parquet",
    params:
        settings=filter_settings,
        code=code_of("prepare_bench"),
    log:
        "results/logs/prepare_bench/{kind}-{instrument}.log",
    wildcard_constraints:
        kind="[a-z]+",
        instrument="[a-z0-9]+",
    script:
        "../scripts/prepare_bench.py"
