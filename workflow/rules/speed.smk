"""What the benchmarks measured, for the report: stored tables, made by `python -m benchmarks`."""

from rotorid.report.provenance import stored_with


def stored_benchmarks(wildcards, input):
    """The commit that each benchmark's table came with, by name."""
    return {name: stored_with(ROOT, path) for name, path in input.items()}


rule chapter_speed:
    """Tables of the benchmarks."""
    message:
        "Chapter speed: tables"
    input:
        simulator="benchmarks/simulator.md",
        selection="benchmarks/selection.md",
        importing="benchmarks/importing.md",
        mismatch="benchmarks/mismatch.md",
        rebuild="benchmarks/rebuild.md",
        fleet="benchmarks/fleet.md",
        fem="benchmarks/fem.md",
    output:
        simulator="results/report/speed/simulator.csv",
        selection="results/report/speed/selection.csv",
        importing="results/report/speed/importing.csv",
        mismatch="results/report/speed/mismatch.csv",
        rebuild="results/report/speed/rebuild.csv",
        fleet="results/report/speed/fleet.csv",
        fem="results/report/speed/fem.csv",
        stored="results/report/speed/stored.json",
    params:
        stored=stored_benchmarks,
        code=code_of("tabulate_speed"),
    log:
        "results/logs/chapter_speed.log",
    script:
        "../scripts/tabulate_speed.py"
