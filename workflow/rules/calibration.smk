"""Load cells of the bench: from known weights and readings to coefficients."""


rule calibrate_load_cells:
    """Line of each cell through the thesis's printed readings, next to the coefficients it prints."""
    message:
        "Calibration: load cells of the thesis"
    input:
        weights="raw/thesis/table_2_6.csv",
        readings="raw/thesis/table_2_7.csv",
        printed="raw/thesis/table_2_8.csv",
    output:
        coefficients="results/calibration/thesis.json",
    params:
        code=code_of("calibrate_load_cells"),
    log:
        "results/logs/calibrate_load_cells/thesis.log",
    script:
        "../scripts/calibrate_load_cells.py"


rule chapter_loadcell:
    """Figures and tables of the load-cell chapter."""
    message:
        "Chapter loadcell: figures and tables"
    input:
        notebook="notebooks/loadcell.ipynb",
        weights="raw/thesis/table_2_6.csv",
        readings="raw/thesis/table_2_7.csv",
        calibration=rules.calibrate_load_cells.output.coefficients,
    output:
        lines=report(
            "results/report/loadcell/lines.svg",
            category="Load cells",
            caption="../report/captions/loadcell.rst",
            labels={"figure": "lines"},
        ),
        printed=report(
            "results/report/loadcell/printed.svg",
            category="Load cells",
            caption="../report/captions/loadcell.rst",
            labels={"figure": "printed"},
        ),
        weighed="results/report/loadcell/weighed.csv",
        read="results/report/loadcell/read.csv",
        coefficients="results/report/loadcell/coefficients.csv",
        flagged="results/report/loadcell/flagged.csv",
    params:
        code=code_of_chapter("loadcell"),
    log:
        "results/logs/chapter_loadcell/run.log",
        notebook="results/notebooks/loadcell.ipynb",
    script:
        "../scripts/run_notebook.py"
