"""Flights as arrays."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as _Path
from typing import TYPE_CHECKING, Any

import numpy as np

from quadlab import _quadlab
from quadlab.running import Files, Model, Path

if TYPE_CHECKING:
    import pandas
    import polars


class Flight(Mapping[str, np.ndarray]):
    """A flight: a NumPy array of 64-bit numbers for each column of the flight file, NaN where a value is missing.

    Units are SI, axes north-east-down and forward-right-down: `t`, `x`, `y`, `z`, `phi`, `theta`, `psi`, `p`, `q`, `r`,
    `cmd1` to `cmd4`, `vbat`, and what else was logged. `to_pandas()` and the Arrow C stream (pyarrow) are on the same
    memory: what is written there changes the flight. `to_polars()` copies.
    """

    def __init__(self, columns: Mapping[str, Any], name: str = "flight.csv"):
        self.name = name
        self.columns = {key: np.ascontiguousarray(values, dtype=np.float64) for key, values in columns.items()}
        if len({len(values) for values in self.columns.values()}) > 1:
            raise _quadlab.QuadlabError(f"{name}: its columns differ in length; give each a value for every row")

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Flight) or list(self) != list(other):
            return False
        return all(np.array_equal(self[column], other[column], equal_nan=True) for column in self)

    __hash__ = object.__hash__

    def between(self, from_s: float, to_s: float) -> Flight:
        """The part of the flight between two times, both included."""
        kept = (self["t"] >= from_s) & (self["t"] <= to_s)
        return Flight({column: values[kept] for column, values in self.columns.items()}, self.name)

    @property
    def rows(self) -> int:
        """Samples."""
        return next((len(values) for values in self.columns.values()), 0)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last, s."""
        return float(self["t"][-1] - self["t"][0]) if self.rows else 0.0

    def save(self, path: Path) -> None:
        """Writes a flight file, whole or not at all."""
        path = _Path(path)
        part = path.with_name(path.name + ".part")
        with open(part, "w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self.columns)
            lists = [values.tolist() for values in self.columns.values()]
            writer.writerows([["" if value != value else repr(value) for value in row] for row in zip(*lists)])
        os.replace(part, path)

    def to_pandas(self) -> pandas.DataFrame:
        """A pandas DataFrame on the same memory."""
        import pandas

        return pandas.DataFrame(self.columns, copy=False)

    def to_polars(self) -> polars.DataFrame:
        """A polars DataFrame."""
        import polars

        return polars.DataFrame(self)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        import pyarrow

        return pyarrow.table(self.columns).__arrow_c_stream__(requested_schema)

    def plot(self, columns: str | list[str] | None = None) -> Any:
        """Draws columns over time with matplotlib; see `quadlab.plot.flight`."""
        from quadlab import plot

        return plot.flight(self, columns)

    def __repr__(self) -> str:
        return f"Flight({self.name!r}, {self.rows} samples, {self.duration_s:.1f} s)"


def read_all(path: Path) -> list[Flight]:
    """The flights of a log, of whatever program, or of a flight file."""
    return [Flight(columns, name) for name, columns in _quadlab.read(os.fspath(path))]


def read(path: Path) -> Flight:
    """The one flight of a flight file or log."""
    flights = read_all(path)
    if len(flights) != 1:
        names = ", ".join(flight.name for flight in flights)
        raise _quadlab.QuadlabError(f"{os.fspath(path)}: holds {len(flights)} flights ({names}); use quadlab.read_all")
    return flights[0]


def simulate(
    model: Model | Path,
    *,
    gains: Path | None = None,
    waypoints: list[tuple[float, float, float, float, float]] | None = None,
    duration_s: float = 30.0,
    start_m: tuple[float, float, float] = (0.0, 0.0, -1.0),
    delay_samples: int = 2,
    noise: float = 1.0,
    gusts: tuple[float, float] | None = None,
    wind_m_s: tuple[float, float] | None = None,
    motor_faults: Sequence[tuple[int, str, float, float]] = (),
    excitation: bool = True,
    seed: int = 0,
    name: str | None = None,
) -> Flight:
    """Flies a model under its gains, as software in the loop, and records the flight.

    waypoints: time (s), north, east, down (m) and yaw (rad) of each; without, a tour of a cage of 7.6 m x 5.2 m that
        differs from seed to seed.
    delay_samples: age of the poses that the law gets.
    noise: of the sensors, 1 as in the thesis' laboratory, 0 for none.
    gusts: standard deviation (m/s) and correlation time (s) of the wind on each axis.
    wind_m_s: steady wind, north and east.
    motor_faults: motor from 1, "dead", "weak" or "stuck", since when (s), and by how many command units where weak.
    excitation: steps on the motor commands, for identification.
    name: of the flight; by model and seed without.
    """
    for waypoint in waypoints or []:
        if len(waypoint) != 5:
            raise _quadlab.QuadlabError(f"waypoints: {waypoint} is not time, north, east, down, yaw")
    with Files() as files:
        wanted = {
            "model": files.model(model), "gains": gains, "waypoints": waypoints, "duration_s": duration_s,
            "wind_m_s": wind_m_s, "motor_faults": list(motor_faults),
            "start_m": start_m, "delay_samples": delay_samples, "noise": noise, "gusts": gusts,
            "excitation": excitation, "seed": seed,
        }
        own_name, columns = _quadlab.simulate(wanted)
    return Flight(columns, name or f"{_Path(own_name).stem}-{seed}.csv")
