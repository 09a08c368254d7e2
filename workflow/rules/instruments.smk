"""Drawings of the instruments and the vehicle."""


rule chapter_instruments:
    """Drawings of the instruments chapter."""
    message:
        "Chapter instruments: drawings"
    input:
        notebook="notebooks/instruments.ipynb",
        geometry=BENCH_GEOMETRY,
        vehicle=THESIS_VEHICLE,
    output:
        signal_chain="results/report/instruments/signal_chain.svg",
        bench="results/report/instruments/bench.svg",
        vehicle_figure="results/report/instruments/vehicle.svg",
        stand="results/report/instruments/stand.svg",
    params:
        code=code_of_chapter("instruments"),
    log:
        "results/logs/chapter_instruments/run.log",
        notebook="results/logs/chapter_instruments/instruments.ipynb",
    script:
        "../scripts/run_notebook.py"
