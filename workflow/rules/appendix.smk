"""Tables of the report's appendix, and the graph of its rules."""


def rules_of_report(wildcards):
    """Which rule's files are read by which, on the way to the report."""
    return rules_behind(rules.typeset_pdf.output.pdf, rules.build_html.output.html)


APPENDIX_SECTIONS = ["filter", "bench", "stand", "rotor", "residuals", "simulation", "grey_box", "black_box"]


rule chapter_appendix:
    """Settings, controller, excitation of the experiments, what was read."""
    message:
        "Chapter appendix: tables"
    input:
        lock="requirements.lock",
        project="pyproject.toml",
        weights="raw/thesis/table_2_6.csv",
        readings="raw/thesis/table_2_7.csv",
        geometry=BENCH_GEOMETRY,
        moduli=BENCH_MODULI,
        strengths="raw/thesis/table_2_5.csv",
        coefficients="raw/thesis/table_2_8.csv",
        sizes=BENCH_SIZES,
        vehicle=THESIS_VEHICLE,
        components="raw/vehicle/components.csv",
        public=MANIFEST,
    output:
        gains="results/report/appendix/gains.csv",
        references="results/report/appendix/references.csv",
        experiments="results/report/appendix/experiments.csv",
        settings="results/report/appendix/settings.csv",
        hashes="results/report/appendix/hashes.csv",
        versions="results/report/appendix/versions.csv",
        rule_graph=report(
            "results/report/appendix/rule_graph.svg",
            category="Appendix",
            caption="../report/captions/appendix.rst",
            labels={"figure": "rule graph"},
        ),
    params:
        config={name: getattr(CONFIG, name).model_dump() for name in APPENDIX_SECTIONS},
        steps=rules_of_report,
        code=code_of("tabulate_appendix"),
    log:
        "results/logs/chapter_appendix.log",
    script:
        "../scripts/tabulate_appendix.py"
