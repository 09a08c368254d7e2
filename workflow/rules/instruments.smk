"""Drawings of the instruments and the vehicle."""


rule chapter_instruments:
    """Drawings of the instruments chapter."""
    message:
        "Chapter instruments: drawings"
    input:
        notebook="notebooks/instruments.ipynb",
        geometry=BENCH_GEOMETRY,
        vehicle=THESIS_VEHICLE,
        parts="raw/thesis/table_3_1.csv",
        ratings="raw/thesis/table_3_2.csv",
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
        wiring=report(
            "results/report/instruments/wiring.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "wiring of the bench"},
        ),
        flow=report(
            "results/report/instruments/flow.svg",
            category="Instruments",
            caption="../report/captions/instruments.rst",
            labels={"figure": "flow of the recorder"},
        ),
        distances="results/report/instruments/distances.csv",
        components="results/report/instruments/components.csv",
        sensor="results/report/instruments/sensor.csv",
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
        notebook="results/notebooks/instruments.ipynb",
    script:
        "../scripts/run_notebook.py"
