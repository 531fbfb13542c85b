"""The commands of quadlab as functions: each takes the options of the command of the same name.

Written by `generate.py` from what the program says of its options; do not edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from quadlab.running import Flights, Model, Path, Result, run

__all__ = [
    "init",
    "import_log",
    "identify",
    "compare",
    "diagnose",
    "add",
    "explain",
    "discover",
    "effects",
    "linearize",
    "export",
    "design",
    "design_check",
    "design_report",
    "campaign_plan",
    "campaign_run",
    "campaign_merge",
    "campaign_report",
    "campaign_replay",
    "campaign_why",
    "campaign_search",
    "fleet",
    "motor_map",
    "excite",
    "plan",
]


def init(
    logs: Flights,
    *,
    out: Path,
    force: bool = False,
) -> Result:
    """Make a vehicle file from logs and mark what you still have to measure.

    Fills in motor order, spin, command range and rotor positions, air density and gravity where the
    logs have them. Mass, sizes and the tracked point must be measured: the file says how. Until then
    the file holds typical values, and every command warns you of that.

    logs: Logs of the craft: files, folders or patterns such as '*.ulg'.
    out: Vehicle file to write.
    force: Overwrite existing output files.
    """
    options = {
        "logs": (None, logs),
        "out": ("out", out),
        "force": ("force", force),
    }
    return run(["init"], options, has_json=True, makes_model=False)


def import_log(
    logs: Flights,
    *,
    out: Path,
    force: bool = False,
    apply: bool = False,
) -> Result:
    """Make flight files from logs of other programs.

    Reads PX4 ULog, ArduPilot DataFlash, Betaflight and INAV blackbox, Crazyflie SD-card logs, ROS 1 and
    ROS 2 bags, MCAP, Parquet, CSV under any names (a columns.toml beside them says which column is
    which), and recordings of `quadlab ground`. Prints how far the log's clocks are apart, and what was
    cut out. Writes a flight file for each part that was flown, and a vehicle file that marks what you
    still have to measure; an existing one is kept unless force is given. Every command that takes
    flights also takes logs: import only saves the flights as files. `refused` says why logs are
    refused; the others are still imported.

    logs: Logs: files, folders, patterns such as '*.ulg', or - for standard input.
    out: Folder to write the flight files and the vehicle file to; created if missing.
    force: Overwrite existing flight files and an existing vehicle file.
    apply: Fix wrong axes, signs and motor orders of tables: write the proposed corrections to
        columns.toml beside them, and continue.
    """
    options = {
        "logs": (None, logs),
        "out": ("out", out),
        "force": ("force", force),
        "apply": ("apply", apply),
    }
    return run(["import"], options, has_json=True, makes_model=False)


def identify(
    flights: Flights | None = None,
    *,
    vehicle: Path | None = None,
    train: Flights | None = None,
    validate: Flights | None = None,
    effects: Path | Sequence[Path] | None = None,
    refine: bool | Literal["moments", "all"] | None = None,
    out: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Identify the basic model from flights.

    Fits thrust, drag, rotor moments, inertia coupling, gyroscopic torque and angular damping to the
    training flights by least squares, tests them on the held-out flights, and writes the model.

    vehicle: Vehicle file, with what was measured before any flight.
    flights: Flights and logs to split into training and held-out sets, instead of train and validate:
        by flight, by airborne part, or by blocks of time if there is only one.
    train: Training flights: files, folders or patterns such as 'A*.csv'.
    validate: Held-out flights, used to test the fit and never for it.
    effects: Files with effects of your own, written as formulas.
    refine: Refine the coefficients of the moments, or all, so that open-loop predictions over half a
        second fit best. Kept only if the held-out flights are predicted better.
    out: Model file to write. Without it, only the result has the model.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "vehicle": ("vehicle", vehicle),
        "flights": (None, flights),
        "train": ("train", train),
        "validate": ("validate", validate),
        "effects": ("effects", effects),
        "refine": ("refine", refine),
        "out": ("out", out),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["identify"], options, has_json=True, makes_model=True)


def compare(
    *,
    model: Model | Path | Sequence[Model | Path],
    flights: Flights,
    html: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Compare a model with flights: errors of each axis, open-loop prediction, and where it fails most.

    model: Model files, several to see them side by side.
    flights: Flights to compare with: files, folders or patterns.
    html: Page with figures to write.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "flights": ("flights", flights),
        "html": ("html", html),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["compare"], options, has_json=True, makes_model=False)


def diagnose(
    flights: Flights | None = None,
    *,
    model: Model | Path,
    train: Flights | None = None,
    validate: Flights | None = None,
    effects: Path | Sequence[Path] | None = None,
    changed: Flights | None = None,
    why: str | None = None,
    without: str | Sequence[str] | None = None,
    html: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Say which physical effect a model lacks, with the evidence for each.

    Every effect of the catalogue is fitted together with the whole model on the training flights and
    tested on the held-out flights. An effect is supported when it lowers the error there by more than
    chance would and by enough to matter, with coefficients that are physically possible. `holds` is
    False if the flights do not determine the model; it then says what to fly.

    With changed, instead of train and validate, the model's coefficients stay fixed, and the residual
    of new flights is explained by one change (a heavier craft, a weak motor, wind, ...). The change
    must stand out from the scatter between the flights that the model was fitted to.

    model: Model file.
    flights: Flights and logs to split into training and held-out sets, instead of train and validate:
        by flight, by airborne part, or by blocks of time if there is only one.
    train: Training flights: files, folders or patterns such as 'A*.csv'.
    validate: Held-out flights, used to test the fit and never for it.
    effects: Files with effects of your own, written as formulas.
    changed: New flights, to find what has changed since the model was fitted.
    why: Show all the evidence for and against one effect, missing or in the model; with changed, for
        and against the changes that it can be.
    without: Ignore these effects, as if the catalogue did not have them.
    html: Page with figures to write.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "flights": (None, flights),
        "train": ("train", train),
        "validate": ("validate", validate),
        "effects": ("effects", effects),
        "changed": ("changed", changed),
        "why": ("why", why),
        "without": ("without", without),
        "html": ("html", html),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["diagnose"], options, has_json=True, makes_model=False)


def add(
    effect: str,
    flights: Flights | None = None,
    *,
    model: Model | Path,
    train: Flights | None = None,
    validate: Flights | None = None,
    effects: Path | Sequence[Path] | None = None,
    refine: bool | Literal["moments", "all"] | None = None,
    out: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Add a physical effect to a model and fit the whole model again.

    Prints the error of each axis on the held-out flights before and after. An effect that the flights
    do not support is added all the same, and the output says so.

    effect: The effect's identifier, for example: ground-effect.
    model: Model file to start from.
    flights: Flights and logs to split into training and held-out sets, instead of train and validate:
        by flight, by airborne part, or by blocks of time if there is only one.
    train: Training flights: files, folders or patterns such as 'A*.csv'.
    validate: Held-out flights, used to test the fit and never for it.
    effects: Files with effects of your own, written as formulas.
    refine: Refine the coefficients of the moments, or all, so that open-loop predictions over half a
        second fit best. Kept only if the held-out flights are predicted better.
    out: Model file to write. Without it, only the result has the model.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "effect": (None, effect),
        "model": ("model", model),
        "flights": (None, flights),
        "train": ("train", train),
        "validate": ("validate", validate),
        "effects": ("effects", effects),
        "refine": ("refine", refine),
        "out": ("out", out),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["add"], options, has_json=True, makes_model=True)


def explain(
    flights: Flights | None = None,
    *,
    vehicle: Path | None = None,
    train: Flights | None = None,
    validate: Flights | None = None,
    effects: Path | Sequence[Path] | None = None,
    without: str | Sequence[str] | None = None,
    refine: bool | Literal["moments", "all"] | None = None,
    discover: bool = False,
    out: Path | None = None,
    html: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Identify the basic model, then add effects until the flights support no further one.

    An effect is added only if the held-out flights support it. The error after every step is kept in
    the model's history. `holds` is False if the flights do not determine the model; it then says what
    to fly.

    vehicle: Vehicle file, with what was measured before any flight.
    flights: Flights and logs to split into training and held-out sets, instead of train and validate:
        by flight, by airborne part, or by blocks of time if there is only one.
    train: Training flights: files, folders or patterns such as 'A*.csv'.
    validate: Held-out flights, used to test the fit and never for it.
    effects: Files with effects of your own, written as formulas.
    without: Ignore these effects, as if the catalogue did not have them.
    refine: Refine the coefficients of the moments, or all, so that open-loop predictions over half a
        second fit best. Kept only if the held-out flights are predicted better.
    discover: Search the residual of the final model for a formula, as `quadlab discover` does.
    out: Model file to write. Without it, only the result has the model.
    html: Page with figures to write.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "vehicle": ("vehicle", vehicle),
        "flights": (None, flights),
        "train": ("train", train),
        "validate": ("validate", validate),
        "effects": ("effects", effects),
        "without": ("without", without),
        "refine": ("refine", refine),
        "discover": ("discover", discover),
        "out": ("out", out),
        "html": ("html", html),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["explain"], options, has_json=True, makes_model=True)


def discover(
    flights: Flights | None = None,
    *,
    model: Model | Path | None = None,
    vehicle: Path | None = None,
    train: Flights | None = None,
    validate: Flights | None = None,
    effects: Path | Sequence[Path] | None = None,
    without: str | Sequence[str] | None = None,
    out: Path | None = None,
    html: Path | None = None,
    accept_faults: bool = False,
    apply: bool = False,
    from_s: float | None = None,
    to_s: float | None = None,
    force: bool = False,
) -> Result:
    """Find a formula for an effect that is not in the catalogue.

    Known effects come first: those that the model lacks are added. The residual is then searched for a
    force or a moment that depends on measured quantities, on place or on time. The form is chosen on
    the training flights and tested on the held-out ones: it takes two training flights and one held-out
    flight at least; three and two are better. With out it is written as an effect of your own, which
    `quadlab add effects` takes. Where nothing is left, nothing is proposed; where no formula predicts
    the residual of other flights (turbulence), the answer is `not-a-formula`.

    model: Model file to start from.
    vehicle: Vehicle file, where there is no model yet.
    flights: Flights and logs to split into training and held-out sets, instead of train and validate:
        by flight, by airborne part, or by blocks of time if there is only one.
    train: Training flights: files, folders or patterns such as 'A*.csv'.
    validate: Held-out flights, used to test the fit and never for it.
    effects: Files with effects of your own, written as formulas.
    without: Ignore these effects, as if the catalogue did not have them.
    out: File of effects to write.
    html: Page with each form drawn over the residual.
    accept_faults: Continue with flights whose axes, signs or motor order are recognised as wrong; the
        results will be wrong too.
    apply: Fix wrong axes, signs and motor orders: write the proposed corrections to columns.toml beside
        the flights, and continue.
    from_s: Use the flights from this time on (column t, in s), even where the craft is not flying.
    to_s: Use the flights up to this time (column t, in s), even where the craft is not flying.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "vehicle": ("vehicle", vehicle),
        "flights": (None, flights),
        "train": ("train", train),
        "validate": ("validate", validate),
        "effects": ("effects", effects),
        "without": ("without", without),
        "out": ("out", out),
        "html": ("html", html),
        "accept_faults": ("accept-faults", accept_faults),
        "apply": ("apply", apply),
        "from_s": ("from", from_s),
        "to_s": ("to", to_s),
        "force": ("force", force),
    }
    return run(["discover"], options, has_json=True, makes_model=False)


def effects(
    *,
    effects: Path | Sequence[Path] | None = None,
) -> Result:
    """List the physical effects that a model can have.

    effects: Files with effects of your own, written as formulas.
    """
    options = {
        "effects": ("effects", effects),
    }
    return run(["effects"], options, has_json=True, makes_model=False)


def linearize(
    *,
    model: Model | Path,
    at: Path | None = None,
    cancel: float | None = None,
) -> Result:
    """Linearise a model about an equilibrium: A, B, C, D and the transfer function of each channel.

    model: Model file.
    at: Equilibrium to linearise about: "hover", or a trim file with the motion to hold.
    cancel: Relative distance (a fraction) below which a pole and a zero cancel; 0 keeps them all.
    """
    options = {
        "model": ("model", model),
        "at": ("at", at),
        "cancel": ("cancel", cancel),
    }
    return run(["linearize"], options, has_json=True, makes_model=False)


def export(
    *,
    model: Model | Path,
    to: Literal["mujoco", "gazebo", "rotorpy", "px4", "python-control", "octave", "c"],
    gains: Path | None = None,
    at: Path | None = None,
    out: Path,
    force: bool = False,
) -> Result:
    """Write a model for another simulator or design tool.

    What the file omits or approximates is listed in it and on standard output.

    model: Model file.
    to: Target tool.
    gains: Gains file, for to c only.
    at: For design tools only: equilibrium to linearise about, "hover" or a trim file with the motion to
        hold, as for linearize.
    out: File to write.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "to": ("to", to),
        "gains": ("gains", gains),
        "at": ("at", at),
        "out": ("out", out),
        "force": ("force", force),
    }
    return run(["export"], options, has_json=True, makes_model=False)


def design(
    *,
    model: Model | Path,
    specs: Path | None = None,
    out: Path,
    campaign: Path | None = None,
    allow: float | None = None,
    accept_unidentified: bool = False,
    force: bool = False,
) -> Result:
    """Design gains for a model, step by step; or check gains. `holds` is False if a specification cannot
    be met.

    model: Model file.
    specs: Specifications.
    out: Gains file to write.
    campaign: Campaign to fly with the gains before they are written: scenarios and what is not known;
        its model and gains are those of the design.
    allow: Maximum losses allowed, percent of the draws: "allow 0.1" requires the upper end of the 95 %
        interval to be below 1 in 1,000 in every scenario.
    accept_unidentified: Design for a model although its flights do not determine it; the gains are as
        wrong as the model.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "specs": ("specs", specs),
        "out": ("out", out),
        "campaign": ("campaign", campaign),
        "allow": ("allow", allow),
        "accept_unidentified": ("accept-unidentified", accept_unidentified),
        "force": ("force", force),
    }
    return run(["design"], options, has_json=True, makes_model=False)


def design_check(
    *,
    model: Model | Path,
    gains: Path,
    delay: int | None = None,
    continuous: bool = False,
    samples: int | None = None,
    seed: int | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Check gains on a model: margins, poles, responses, worst cases. `holds` is False if a loop is
    unstable, also at another battery voltage or in one of the random draws of the model.

    model: Model file.
    gains: Gains file.
    delay: Age of the pose that the law receives, in samples (thesis 5.5: about 2).
    continuous: Check the continuous loops that the thesis designs, without sampling and delay.
    samples: Number of random draws of the model's coefficients within their standard errors.
    seed: Seed of the draws.
    html: Page with figures to write.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "gains": ("gains", gains),
        "delay": ("delay", delay),
        "continuous": ("continuous", continuous),
        "samples": ("samples", samples),
        "seed": ("seed", seed),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["design", "check"], options, has_json=True, makes_model=False)


def design_report(
    *,
    model: Model | Path | None = None,
    gains: Path | None = None,
    delay: int | None = None,
    samples: int | None = None,
    seed: int | None = None,
    out: Path,
    force: bool = False,
) -> Result:
    """Chapter 5 of the thesis on one page: every figure as computed here, with its numbers beside those of
    the thesis. `holds` is False if a loop is unstable as it flies, or if a number that the thesis
    prints of its own vehicle is not reproduced.

    model: Model file; the thesis' vehicle if not given.
    gains: Gains file; the thesis' gains if not given.
    delay: Age of the pose in the loops as they fly, samples.
    samples: Number of random draws of the model's coefficients within their standard errors.
    seed: Seed of the draws.
    out: Page to write.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "gains": ("gains", gains),
        "delay": ("delay", delay),
        "samples": ("samples", samples),
        "seed": ("seed", seed),
        "out": ("out", out),
        "force": ("force", force),
    }
    return run(["design", "report"], options, has_json=True, makes_model=False)


def campaign_plan(
    definition: Path,
    *,
    out: Path | None = None,
    shards: int | None = None,
    force: bool = False,
) -> Result:
    """Make a plan of a definition: one file with everything that its flights need.

    definition: Definition (TOML), for example: campaign.toml.
    out: Plan file to write.
    shards: Shards that it is flown in [default: one for each 2000 flights].
    force: Overwrite existing output files.
    """
    options = {
        "definition": (None, definition),
        "out": ("out", out),
        "shards": ("shards", shards),
        "force": ("force", force),
    }
    return run(["campaign", "plan"], options, has_json=True, makes_model=False)


def campaign_run(
    plan: Path,
    *,
    out: Path,
    shard: int | None = None,
) -> Result:
    """Fly a plan, or one shard of it. Shards whose parts are in the folder already, and whole, are not
    flown again.

    plan: Plan file.
    out: Folder for the parts.
    shard: Only this shard, counted from 0 [default: that of the cluster's environment, else all].
    """
    options = {
        "plan": (None, plan),
        "out": ("out", out),
        "shard": ("shard", shard),
    }
    return run(["campaign", "run"], options, has_json=False, makes_model=False)


def campaign_merge(
    plan: Path,
    *,
    parts: Path,
) -> Result:
    """Join the parts of a plan into one Parquet file: a row for each flight.

    plan: Plan file.
    parts: Folder with the parts; cases.parquet is written there.
    """
    options = {
        "plan": (None, plan),
        "parts": ("parts", parts),
    }
    return run(["campaign", "merge"], options, has_json=False, makes_model=False)


def campaign_report(
    plan: Path,
    *,
    parts: Path,
    allow: float | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Report how often the craft was lost, which gains are safer, and what drives it. `holds` is False if
    it was lost more often than allow says.

    plan: Plan file.
    parts: Folder with the parts.
    allow: Maximum losses allowed, percent of the draws: fails unless the upper end of the 95 % interval
        is below it for all gains in every scenario.
    html: Page to write.
    force: Overwrite existing output files.
    """
    options = {
        "plan": (None, plan),
        "parts": ("parts", parts),
        "allow": ("allow", allow),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["campaign", "report"], options, has_json=True, makes_model=False)


def campaign_replay(
    plan: Path,
    case: int,
    *,
    html: Path | None = None,
    out: Path | None = None,
    force: bool = False,
) -> Result:
    """Fly one case of a plan again, to look at it.

    plan: Plan file.
    case: Number of the case.
    html: Page to write.
    out: Flight file to write.
    force: Overwrite existing output files.
    """
    options = {
        "plan": (None, plan),
        "case": (None, case),
        "html": ("html", html),
        "out": ("out", out),
        "force": ("force", force),
    }
    return run(["campaign", "replay"], options, has_json=True, makes_model=False)


def campaign_why(
    plan: Path,
    case: int,
) -> Result:
    """Find a minimal set of conditions that causes the loss in a case, with all others nominal.

    plan: Plan file.
    case: Number of the case.
    """
    options = {
        "plan": (None, plan),
        "case": (None, case),
    }
    return run(["campaign", "why"], options, has_json=True, makes_model=False)


def campaign_search(
    plan: Path,
    *,
    gains: str | None = None,
    scenario: str | None = None,
    flights: int | None = None,
    seed: int | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Search the uncertain ranges for a loss, and fly as many random draws for comparison. `holds` is
    False if a loss is found.

    plan: Plan file.
    gains: Gains to try [default: the first of the plan].
    scenario: Scenario to fly [default: the first of the plan].
    flights: Flights of the search, rounded up to a multiple of 24, and as many random draws.
    seed: Seed of the search.
    html: Page to write.
    force: Overwrite existing output files.
    """
    options = {
        "plan": (None, plan),
        "gains": ("gains", gains),
        "scenario": ("scenario", scenario),
        "flights": ("flights", flights),
        "seed": ("seed", seed),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["campaign", "search"], options, has_json=True, makes_model=False)


def fleet(
    folder: Path,
    *,
    index: Path | None = None,
    verify: bool = False,
    refresh: bool = False,
    forget: bool = False,
    effects: str | Sequence[str] | None = None,
    without: str | Sequence[str] | None = None,
    craft: str | Sequence[str] | None = None,
    leave_out: str | Sequence[str] | None = None,
    since: str | None = None,
    until: str | None = None,
    no_causes: bool = False,
    check: bool = False,
    out: Path | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Follow many flights of many craft: each craft's model over time, what changed when and why, which
    craft and batteries differ, which loggers have faults.

    Each flight is read once; an index keeps its normal equations, so that new flights, fewer flights or
    other effects are answered without reading a log again.

    folder: Folder with a folder for each craft, or of one craft.
    index: Index to keep what was read in [default: .quadlab/fleet.parquet in the folder].
    verify: Compare the content of every file with the index, even if its size and modification time
        match.
    refresh: Rebuild the reference model of each craft, and read all flights again with it.
    forget: Forget flights whose files are gone.
    effects: Fit these effects beside the basic ones.
    without: Leave these effects out of the fit.
    craft: Look at these craft only.
    leave_out: Leave flights out, by their paths in the folder.
    since: Look at flights from this date on.
    until: Look at flights up to this date.
    no_causes: Do not search the logs around a change for its cause (what `quadlab diagnose changed`
        does).
    check: `holds` is False if a craft changed.
    out: Folder for tables of flights, histories and changes, as Parquet and CSV.
    html: Page to write.
    force: Overwrite existing output files.
    """
    options = {
        "folder": (None, folder),
        "index": ("index", index),
        "verify": ("verify", verify),
        "refresh": ("refresh", refresh),
        "forget": ("forget", forget),
        "effects": ("effects", effects),
        "without": ("without", without),
        "craft": ("craft", craft),
        "leave_out": ("leave-out", leave_out),
        "since": ("since", since),
        "until": ("until", until),
        "no_causes": ("no-causes", no_causes),
        "check": ("check", check),
        "out": ("out", out),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["fleet"], options, has_json=True, makes_model=False)


def motor_map(
    *,
    vehicle: Path,
    craft: Flights,
    rotor: Flights,
    motor: int | None = None,
    without_voltage: bool = False,
    out: Path | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Find the motor map (command and voltage to rotor speed) and the motors' lag on a test stand.

    The craft logs commands and voltage; another computer logs the rotor speed on a clock of its own.
    One fit estimates the offset and drift between the clocks, the map and the lag, with standard
    errors. Maps with more and with fewer terms are compared on held-out parts of the run.

    vehicle: Vehicle file: rotor radius, mass and command range of the craft on the stand.
    craft: Log of the craft: commands and voltage.
    rotor: Log of the tachometer: rotor speeds.
    motor: Which motor is on the stand; needed if one rotor was measured and the four commands differ.
    without_voltage: Fit command and offset only, for a supply of constant voltage.
    out: Vehicle file to write.
    html: Write a page with figures.
    force: Overwrite existing output files.
    """
    options = {
        "vehicle": ("vehicle", vehicle),
        "craft": ("craft", craft),
        "rotor": ("rotor", rotor),
        "motor": ("motor", motor),
        "without_voltage": ("without-voltage", without_voltage),
        "out": ("out", out),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["motor-map"], options, has_json=True, makes_model=False)


def excite(
    *,
    model: Model | Path,
    gains: Path | None = None,
    path: str | None = None,
    signal: Literal["thesis", "multisine", "linear-sweep", "log-sweep", "none"] | None = None,
    amplitude: float | None = None,
    band: float | Sequence[float] | None = None,
    duration: float | None = None,
    seed: int | None = None,
    pattern: Flights | None = None,
    out: Path | None = None,
    html: Path | None = None,
    force: bool = False,
) -> Result:
    """Write an informative flight pattern, and predict how well it determines the model's coefficients.

    The current model flies the pattern in simulation. The Fisher information of that flight, for
    residuals coloured like those of real fits, gives the standard error of each coefficient and shows
    which effects of the catalogue would stay unseen. `holds` is False if the craft cannot fly it.

    model: Model file: what is known so far.
    gains: Gains file of the controller that will fly it [default: gains designed for the model].
    path: Path to fly: hover, yaw-round, yaw-swings, height-steps, low-flight, climbs, dashes-forward,
        dashes-sideways, dashes-yawed, shuttle, circle, tour.
    signal: Signal that is added to the motor commands.
    amplitude: Amplitude, in command units, of a sine with the same power [default: 1.5 % of the command
        range].
    band: Lowest and highest frequency of multisines and sweeps, Hz; the highest below half the sampling
        rate.
    duration: Duration, s; also the period of a multisine. Making a multisine of 60 s takes seconds, one
        of 300 s minutes.
    seed: Seed of random sines, phases and the tour.
    pattern: Assess this pattern file instead of making one.
    out: Pattern file to write.
    html: Write a page with figures.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "gains": ("gains", gains),
        "path": ("path", path),
        "signal": ("signal", signal),
        "amplitude": ("amplitude", amplitude),
        "band": ("band", band),
        "duration": ("duration", duration),
        "seed": ("seed", seed),
        "pattern": ("pattern", pattern),
        "out": ("out", out),
        "html": ("html", html),
        "force": ("force", force),
    }
    return run(["excite"], options, has_json=True, makes_model=False)


def plan(
    *,
    model: Model | Path,
    gains: Path | None = None,
    separate: str | Sequence[str] | None = None,
    shrink: str | None = None,
    duration: float | None = None,
    seed: int | None = None,
    out: Path | None = None,
    force: bool = False,
) -> Result:
    """Say what to fly next: the flight that best tells two effects apart or shrinks a standard error.

    The current model flies a library of manoeuvres in simulation; they are ranked by the information
    that they would give. `holds` is False if none gives enough.

    model: Model file: what is known so far.
    gains: Gains file of the controller that will fly it [default: gains designed for the model].
    separate: Two effects to tell apart.
    shrink: Coefficient whose standard error to reduce.
    duration: Duration of the flight, s.
    seed: Seed of phases and the tour.
    out: Pattern file to write, with the best flight.
    force: Overwrite existing output files.
    """
    options = {
        "model": ("model", model),
        "gains": ("gains", gains),
        "separate": ("separate", separate),
        "shrink": ("shrink", shrink),
        "duration": ("duration", duration),
        "seed": ("seed", seed),
        "out": ("out", out),
        "force": ("force", force),
    }
    return run(["plan"], options, has_json=True, makes_model=False)
