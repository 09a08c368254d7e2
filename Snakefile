"""From raw logs to the report. One screen: the stages are in workflow/rules, one file each."""

import atexit

from snakemake.utils import min_version

min_version("9.27")


configfile: "config.yaml"


include: "workflow/rules/common.smk"
include: "workflow/rules/public.smk"
include: "workflow/rules/check.smk"
include: "workflow/rules/ingest.smk"
include: "workflow/rules/calibration.smk"
include: "workflow/rules/bench.smk"
include: "workflow/rules/fem.smk"
include: "workflow/rules/rotor.smk"
include: "workflow/rules/neurobem.smk"
include: "workflow/rules/white_box.smk"
include: "workflow/rules/stand.smk"
include: "workflow/rules/grey_box.smk"
include: "workflow/rules/black_box.smk"
include: "workflow/rules/instruments.smk"
include: "workflow/rules/mismatch.smk"
include: "workflow/rules/proof.smk"
include: "workflow/rules/real_flights.smk"
include: "workflow/rules/delivered.smk"
include: "workflow/rules/examples.smk"
include: "workflow/rules/plantings.smk"
include: "workflow/rules/decisions.smk"
include: "workflow/rules/ablation.smk"
include: "workflow/rules/fleet.smk"
include: "workflow/rules/appendix.smk"
include: "workflow/rules/report.smk"


rule all:
    """Everything: the report and all it needs."""
    default_target: True
    message:
        "All results are up to date"
    input:
        rules.report.input,


onstart:
    # For its limit on jobs a second Snakemake looks at the input of every waiting job each second, a tenth of a core.
    # A cluster needs the limit, one machine does not.
    if workflow.local_exec:
        workflow.scheduler.job_rate_limiter = None


onsuccess:
    # The answer is the last thing on the screen: Snakemake says where its log is after this.
    atexit.register(say_verdicts)


onerror:
    # So is the reason why it stopped.
    atexit.register(say_refusals)
