"""What changed between flights of one vehicle whose authors say what they changed."""


rule chapter_changes:
    """What `rotorid compare` states of each labelled pair, and their figures."""
    message:
        "Chapter what changed: comparing labelled flights"
    input:
        normal=public_set("crazypad-normal"),
        weight=public_set("crazypad-weight"),
        cut=public_set("crazypad-cut"),
    output:
        found="results/report/changes/found.json",
        differs_weight=report(
            "results/report/changes/differs_weight.svg",
            category="What changed",
            caption="../report/captions/changes.rst",
            labels={"figure": "what differs with the weight"},
        ),
        differs_cut=report(
            "results/report/changes/differs_cut.svg",
            category="What changed",
            caption="../report/captions/changes.rst",
            labels={"figure": "what differs with the cut propeller"},
        ),
    params:
        code=code_of("compare_labelled"),
    log:
        "results/logs/chapter_changes.log",
    script:
        "../scripts/compare_labelled.py"
