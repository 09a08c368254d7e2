"""From the chapters' figures, tables and texts to the report; included last, after every chapter's rule."""

from rotorid.report.provenance import in_words

PARTS = "workflow/report"


for name in CONFIG.report.chapters:
    if not (ROOT / f"notebooks/{name}.md").is_file():
        refuse(f"config.yaml: report.chapters names {name}, but there is no notebooks/{name}.md.")

# Kinds of recordings that a chapter is made of: where the index lists none of one, a sentence stands in its place.
ALL_KINDS = ["calibration", "static", "combined", "dynamic", "tensile", "thrust", "torque", "dynamics"]
KINDS_OF_CHAPTER = {
    "bench": ["calibration", "static", "combined", "dynamic", "tensile"],
    "stand": ["thrust", "torque", "dynamics"],
    "black_box": ["thrust", "torque", "dynamics"],
    "abstract": ALL_KINDS,
    "conclusions": ALL_KINDS,
    "thesis": ALL_KINDS,
}
# Results that a text without a rule of its own quotes.
QUOTED = {
    "parameters": "results/white_box/parameters.json",
    "calibration": "results/calibration/thesis.json",
    "series": "results/bench/static_series.csv",
    "reconstruction": "results/bench/reconstruction.json",
    "speed_law": "results/stand/characteristic.json",
    "rotor": "results/grey_box/rotor.json",
    "network": "results/grey_box/inertia_network.json",
    "improved": "results/grey_box/inertias.json",
    "black_box": "results/black_box/summary.json",
    "held_out": "results/black_box/held_out_scores.csv",
}
# What the abstract counts is what the chapters print.
PRINTED = {
    "counted": rules.chapter_proof.output.counted,
    "real_state": rules.chapter_real_flights.output.state,
    "mission": rules.chapter_real_flights.output.mission,
    "studies": rules.chapter_real_flights.output.studies,
    "campaign_numbers": rules.score_campaign.output.numbers,
    "effects": rules.chapter_catalogue.output.effects,
}
QUOTED_BY = {
    "white_box": {"truth": rules.score_campaign.output.state},
    "abstract": QUOTED | PRINTED,
    "conclusions": QUOTED | PRINTED | {"propellers": "results/rotor/coefficients.json"},
}
RECORDED = {kind for kind, _ in KINDS_RECORDED}
LEFT_OUT = sorted({path.stem for path in Path("notebooks").glob("*.md")} - set(CONFIG.report.chapters))
EMULATED = any(row["source"] == "emulator" for row in SESSIONS)
NOTICE = (
    "The recordings of the thesis's instruments are EMULATED in this report. They were made from the thesis's own "
    "numbers, test the method, and confirm nothing about the thesis's vehicle or bench. Real are the tables quoted "
    "from the thesis and the recordings of other laboratories; captions say which is which."
    if EMULATED
    else "Captions say what each figure and table is made of."
)


CITED = read_yaml(Path("CITATION.cff"))
PROJECT = f"rotorid {CITED['version']}, {', '.join(author['name'] for author in CITED['authors'])}. {CITED['license']} licence."
ORIGIN = in_words(ROOT, CODE.of("workflow/scripts/judge.py"))


def kinds_lacking(chapter):
    """Kinds of recordings that a chapter needs and the index lists too few of."""
    return [kind for kind in KINDS_OF_CHAPTER.get(chapter, []) if kind not in RECORDED]


def kinds_lacking_of(wildcards):
    """The same of the chapter that is rendered."""
    return kinds_lacking(wildcards.chapter)


# A chapter without a rule of its own is text alone.
CHAPTERS = {
    name: getattr(rules, f"chapter_{name}")
    for name in CONFIG.report.chapters
    if f"chapter_{name}" in {known.name for known in workflow.rules} and not kinds_lacking(name)
}


def chapter_files(wildcards):
    """The files that a chapter's text may use, by name: outputs and single inputs of its rule."""
    chapter = CHAPTERS.get(wildcards.chapter)
    named = {**dict(chapter.input.items()), **dict(chapter.output.items())} if chapter else {}
    if not kinds_lacking(wildcards.chapter):
        named |= QUOTED_BY.get(wildcards.chapter, {})
    shown = {".json", ".csv", ".svg", ".png"}
    return {
        name: path for name, path in named.items() if isinstance(path, str) and Path(path).suffix in shown
    }


def chapter_figures(wildcards):
    """Every figure of every chapter."""
    files = [path for chapter in CHAPTERS.values() for path in chapter.output]
    return [path for path in files if Path(path).suffix in {".svg", ".png"}]


def raw_files(wildcards):
    """What instruments wrote (the index and its logs), the thesis's tables, and the list of public recordings."""
    fixed = [path for folder in ("thesis", "vehicle") for path in sorted(Path("raw", folder).glob("*"))]
    logs = [f"{CONFIG.raw}/{row[name]}" for row in SESSIONS for name in ("file", "metadata")]
    return [str(path) for path in fixed] + [INDEX] * bool(SESSIONS) + logs + [MANIFEST]


rule render_chapter:
    """Numbers, tables and figures put into a chapter's text."""
    message:
        "Report: text of chapter {wildcards.chapter}"
    input:
        unpack(chapter_files),
        prose="notebooks/{chapter}.md",
    output:
        markdown="results/report/chapters/{chapter}.md",
    params:
        lacking=kinds_lacking_of,
        index=INDEX,
        emulated=EMULATED,
        code=code_of("render_chapter"),
    log:
        "results/logs/render_chapter/{chapter}.log",
    script:
        "../scripts/render_chapter.py"


rule typeset_pdf:
    """The chapters as a book."""
    message:
        "Report: typesetting the PDF"
    input:
        chapters=expand(rules.render_chapter.output.markdown, chapter=CONFIG.report.chapters),
        figures=chapter_figures,
        template=PARTS + "/report.typ",
        filter=PARTS + "/crossref.lua",
        references=PARTS + "/references.bib",
    output:
        pdf="results/report/report.pdf",
        source="results/report/report.typ",
    params:
        title=CONFIG.report.title,
        subtitle=CONFIG.report.subtitle,
        left_out=LEFT_OUT,
        notice=NOTICE,
        origin=ORIGIN,
        project=PROJECT,
        code=code_of("typeset_pdf"),
    log:
        "results/logs/typeset_pdf.log",
    script:
        "../scripts/typeset_pdf.py"


rule build_html:
    """The chapters as one page that needs no other file."""
    message:
        "Report: building the HTML"
    input:
        chapters=expand(rules.render_chapter.output.markdown, chapter=CONFIG.report.chapters),
        figures=chapter_figures,
        template=PARTS + "/report.html",
        style=PARTS + "/report.css",
        filter=PARTS + "/crossref.lua",
        references=PARTS + "/references.bib",
    output:
        html="results/report/report.html",
    params:
        title=CONFIG.report.title,
        subtitle=CONFIG.report.subtitle,
        left_out=LEFT_OUT,
        notice=NOTICE,
        origin=ORIGIN,
        project=PROJECT,
        code=code_of("build_html"),
    log:
        "results/logs/build_html.log",
    script:
        "../scripts/build_html.py"


rule record_provenance:
    """Versions, commit, configuration and hashes of raw: the only output that may differ between two runs."""
    message:
        "Report: provenance"
    input:
        raw=raw_files,
        lock="requirements.lock",
        report=[rules.typeset_pdf.output.pdf, rules.build_html.output.html],
    output:
        provenance="results/report/provenance.json",
    params:
        config=config,
        code=code_of("record_provenance"),
    log:
        "results/logs/record_provenance.log",
    script:
        "../scripts/record_provenance.py"


def results_of_report(wildcards):
    """All results that the report hangs on."""
    return results_behind(
        rules.typeset_pdf.output.pdf,
        rules.build_html.output.html,
        rules.record_provenance.output.provenance,
    )


rule report:
    """The report and where it came from."""
    message:
        "The report is up to date"
    input:
        results_of_report,
