"""Grey box: parameters by the thesis's networks, then by a better experiment and estimator, then on real flights."""

GREY_FLIGHTS = [public_set("neurobem"), public_set("imrc-brushless")]
GREY_FLIGHT_RATES_HZ = [400.0, 500.0]


rule train_rotor_networks:
    """C_F and C_Q by the linear 1-4-1 network."""
    message:
        "Grey box: rotor networks"
    input:
        thrust=rules.fit_white_box.output.thrust,
        torque=rules.fit_white_box.output.torque,
    output:
        fits="results/grey_box/rotor.json",
        history="results/grey_box/rotor_history.csv",
        sizes="results/grey_box/rotor_sizes.csv",
    params:
        rate=CONFIG.grey_box.rotor_rate,
        epochs=CONFIG.grey_box.rotor_epochs,
        hidden=CONFIG.grey_box.rotor_hidden,
        seed=CONFIG.grey_box.seed,
        code=code_of("train_rotor_networks"),
    log:
        "results/logs/train_rotor_networks.log",
    script:
        "../scripts/train_rotor_networks.py"


rule train_inertia_network:
    """Inertias by the masked network, and the test of its gyroscopic weights."""
    message:
        "Grey box: inertia network"
    input:
        flight=rules.simulate_attitude.output.flight,
        vehicle=THESIS_VEHICLE,
    output:
        fits="results/grey_box/inertia_network.json",
        history="results/grey_box/inertia_history.csv",
    params:
        rate=CONFIG.grey_box.inertia_rate,
        epochs=CONFIG.grey_box.inertia_epochs,
        every=CONFIG.grey_box.inertia_every,
        seed=CONFIG.grey_box.seed,
        code=code_of("train_inertia_network"),
    log:
        "results/logs/train_inertia_network.log",
    script:
        "../scripts/train_inertia_network.py"


rule estimate_inertias:
    """A designed excitation and output error: all three inertias with intervals."""
    message:
        "Grey box: excitation and output error"
    input:
        vehicle=THESIS_VEHICLE,
    output:
        fits="results/grey_box/inertias.json",
        errors="results/grey_box/inertia_draws.csv",
        identifiability="results/grey_box/identifiability.csv",
        traces="results/grey_box/excitation.csv",
    params:
        limits_rad_s=CONFIG.grey_box.speed_limits_rad_s,
        design_limits_rad_s=CONFIG.grey_box.design_limits_rad_s,
        tilt_deg=CONFIG.grey_box.design_tilt_deg,
        harmonics=CONFIG.grey_box.design_harmonics,
        period_s=CONFIG.grey_box.design_period_s,
        candidates=CONFIG.grey_box.design_candidates,
        duration_s=CONFIG.grey_box.flight_s,
        step_s=CONFIG.grey_box.flight_step_s,
        motor_time_s=CONFIG.grey_box.motor_time_s,
        moment_n_m=CONFIG.simulation.moment_n_m,
        force_n=CONFIG.simulation.force_n,
        correlation_s=CONFIG.simulation.correlation_s,
        rate_noise=CONFIG.simulation.rate_noise_rad_s,
        speed_noise_relative=CONFIG.simulation.speed_noise_relative,
        draws=CONFIG.grey_box.draws,
        seed=CONFIG.grey_box.seed,
        code=code_of("estimate_inertias"),
    log:
        "results/logs/estimate_inertias.log",
    script:
        "../scripts/estimate_inertias.py"


rule estimate_flight_inertias:
    """Inertias from flights of other laboratories, next to what they publish."""
    message:
        "Grey box: inertias from real flights"
    input:
        sets=GREY_FLIGHTS,
    output:
        table="results/grey_box/flight_inertias.csv",
        summary="results/grey_box/flight_inertias.json",
    params:
        band_hz=CONFIG.grey_box.band_hz,
        rates_hz=GREY_FLIGHT_RATES_HZ,
        block_s=CONFIG.grey_box.block_s,
        seed=CONFIG.grey_box.seed,
        code=code_of("estimate_flight_inertias"),
    log:
        "results/logs/estimate_flight_inertias.log",
    script:
        "../scripts/estimate_flight_inertias.py"


rule validate_models:
    """White and grey box on a reference and on flights not used for training."""
    message:
        "Grey box: validation"
    input:
        vehicle=THESIS_VEHICLE,
        improved=rules.estimate_inertias.output.fits,
        sets=GREY_FLIGHTS,
        inertias=rules.estimate_flight_inertias.output.summary,
    output:
        traces="results/grey_box/validation.csv",
        summary="results/grey_box/validation.json",
        flights="results/grey_box/validation_flights.csv",
    params:
        band_hz=CONFIG.grey_box.band_hz,
        rates_hz=GREY_FLIGHT_RATES_HZ,
        block_s=CONFIG.grey_box.block_s,
        duration_s=CONFIG.simulation.duration_s,
        seed=CONFIG.grey_box.seed,
        code=code_of("validate_models"),
    log:
        "results/logs/validate_models.log",
    script:
        "../scripts/validate_models.py"


rule chapter_grey_box:
    """Figures and tables of the grey-box chapter."""
    message:
        "Chapter grey box: figures and tables"
    input:
        notebook="notebooks/grey_box.ipynb",
        thrust=rules.fit_white_box.output.thrust,
        torque=rules.fit_white_box.output.torque,
        rotor=rules.train_rotor_networks.output.fits,
        rotor_history=rules.train_rotor_networks.output.history,
        rotor_sizes=rules.train_rotor_networks.output.sizes,
        network=rules.train_inertia_network.output.fits,
        inertia_history=rules.train_inertia_network.output.history,
        improved=rules.estimate_inertias.output.fits,
        draws=rules.estimate_inertias.output.errors,
        promises=rules.estimate_inertias.output.identifiability,
        excitation_traces=rules.estimate_inertias.output.traces,
        flights=rules.estimate_flight_inertias.output.table,
        flight_summary=rules.estimate_flight_inertias.output.summary,
        validation_traces=rules.validate_models.output.traces,
        validation=rules.validate_models.output.summary,
        validation_flights=rules.validate_models.output.flights,
    output:
        networks=report(
            "results/report/grey_box/networks.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "the networks"},
        ),
        learning=report(
            "results/report/grey_box/learning.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "how a network learns"},
        ),
        printed="results/report/grey_box/printed.csv",
        rotor_networks=report(
            "results/report/grey_box/rotor_networks.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "rotor networks"},
        ),
        hidden_sizes=report(
            "results/report/grey_box/hidden_sizes.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "hidden sizes"},
        ),
        inertia_training=report(
            "results/report/grey_box/inertia_training.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "inertia training"},
        ),
        identifiability=report(
            "results/report/grey_box/identifiability.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "identifiability"},
        ),
        excitation=report(
            "results/report/grey_box/excitation.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "excitation"},
        ),
        errors=report(
            "results/report/grey_box/errors.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "errors"},
        ),
        accelerations=report(
            "results/report/grey_box/accelerations.svg",
            category="Grey box",
            caption="../report/captions/grey_box.rst",
            labels={"figure": "accelerations"},
        ),
        parameters="results/report/grey_box/parameters.csv",
        weights="results/report/grey_box/weights.csv",
        methods="results/report/grey_box/methods.csv",
    params:
        code=code_of_chapter("grey_box"),
    log:
        "results/logs/chapter_grey_box/run.log",
        notebook="results/notebooks/grey_box.ipynb",
    script:
        "../scripts/run_notebook.py"
