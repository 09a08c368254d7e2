"""What changed between flights of one vehicle whose authors say what they changed."""


rule chapter_changes:
    """What `rotorid compare` states of each labelled pair, and the figures of one of them."""
    message:
        "Chapter what changed: comparing labelled flights"
    input:
        normal=public_set("crazypad-normal"),
        weight=public_set("crazypad-weight"),
        cut=public_set("crazypad-cut"),
    output:
        found="results/report/changes/found.json",
        values=report(
            "results/report/changes/values.svg",
            category="What changed",
            caption="../report/captions/changes.rst",
            labels={"figure": "values"},
        ),
        residuals=report(
            "results/report/changes/residuals.svg",
            category="What changed",
            caption="../report/captions/changes.rst",
            labels={"figure": "residuals"},
        ),
    params:
        code=code_of("compare_labelled"),
    log:
        "results/logs/chapter_changes.log",
    script:
        "../scripts/compare_labelled.py"
