"""Pictures with matplotlib, with axes and units. Each function returns the figure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from quadlab._quadlab import QuadlabError
from quadlab.flight import Flight, read
from quadlab.running import Model, Path, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS = {
    "position, m": ("x", "y", "z"),
    "attitude, rad": ("phi", "theta", "psi"),
    "rates, rad/s": ("p", "q", "r"),
    "command": ("cmd1", "cmd2", "cmd3", "cmd4"),
    "rotors, rad/s": ("omega1", "omega2", "omega3", "omega4"),
    "battery, V": ("vbat",),
}
"""What is drawn together, by the label of its axis."""
ACCELERATIONS = {**dict.fromkeys("uvw", "m/s²"), **dict.fromkeys("pqr", "rad/s²")}
"""Units of the rows of the equations of motion."""


def _axes(count: int, height: float = 1.7) -> tuple[Figure, Any]:
    from matplotlib import pyplot

    return pyplot.subplots(count, 1, sharex=True, figsize=(9, height * count), squeeze=False, layout="constrained")


def flight(shown: Flight | Path, columns: str | list[str] | None = None) -> Figure:
    """Columns of a flight over time; without a choice, those of `PANELS`."""
    shown = shown if isinstance(shown, Flight) else read(shown)
    known = {column: panel for panel, together in PANELS.items() for column in together}
    wanted = [columns] if isinstance(columns, str) else columns or [column for column in shown if column in known]
    panels: dict[str, list[str]] = {}
    for column in wanted:
        panels.setdefault(known.get(column, column), []).append(column)
    figure, axes = _axes(len(panels))
    for axis, (label, names) in zip(axes[:, 0], panels.items()):
        for name in names:
            axis.plot(shown["t"], shown[name], linewidth=0.8, label=name)
        axis.set_ylabel(label)
        axis.legend(loc="upper right", ncols=len(names), fontsize="small")
    axes[-1, 0].set_xlabel("time, s")
    figure.suptitle(shown.name)
    return figure


def residuals(model: Model | Path, shown: Flight | Path) -> Figure:
    """Measured and predicted accelerations of a flight."""
    model = model if isinstance(model, Model) else Model(model)
    found = model.predict(shown)
    figure, axes = _axes(6)
    for axis, (row, unit) in zip(axes[:, 0], ACCELERATIONS.items()):
        axis.plot(found["t"], found[row], linewidth=0.8, label="measured")
        axis.plot(found["t"], found[f"{row}_predicted"], linewidth=0.8, label="predicted")
        axis.set_ylabel(f"{row}, {unit}")
    axes[0, 0].legend(loc="upper right", ncols=2, fontsize="small")
    axes[-1, 0].set_xlabel("time, s")
    return figure


def coefficients(model: Model | Result) -> Figure:
    """Coefficients of a model in multiples of their standard errors."""
    own = model if isinstance(model, Model) else model.model
    if own is None:
        raise QuadlabError("coefficients: this result has no model")
    table = own.frame().dropna(subset=["std_error"])
    figure, axes = _axes(1, 0.28 * len(table) + 1.0)
    labels = table["effect"] + " " + table["name"]
    axes[0, 0].barh(labels, (table["value"] / table["std_error"]).abs())
    axes[0, 0].invert_yaxis()
    axes[0, 0].set_xscale("log")
    axes[0, 0].set_xlabel("coefficient over its standard error")
    return figure
