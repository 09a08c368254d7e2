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
        signal_chain=report(
            "results/report/instruments/signal_chain.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "signal chain"},
        ),
        bench=report(
            "results/report/instruments/bench.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "bench"},
        ),
        vehicle_figure=report(
            "results/report/instruments/vehicle.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "vehicle"},
        ),
        stand=report(
            "results/report/instruments/stand.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "stand"},
        ),
    params:
        code=code_of_chapter("instruments"),
    log:
        "results/logs/chapter_instruments/run.log",
        notebook="results/logs/chapter_instruments/instruments.ipynb",
    script:
        "../scripts/run_notebook.py"
