"""Flights as arrays, and what other libraries make of them."""

import os
import pathlib

import numpy as np
import pyarrow
import polars
import pytest

import quadlab
from quadlab import plot


def test_a_flight_is_read_as_it_was_written(flights, tmp_path):
    path = tmp_path / "one.csv"
    flights[0].save(path)
    back = quadlab.read(path)
    assert list(back) == list(flights[0])
    assert all(np.array_equal(back[column], flights[0][column], equal_nan=True) for column in back)
    assert back.rows == 2401 and back.duration_s == pytest.approx(24.0)
    numpy = np.genfromtxt(path, delimiter=",", names=True)
    assert np.array_equal(numpy["theta"], back["theta"])


def test_tables_are_the_same_memory(flights):
    flight = flights[0]
    frame = flight.to_pandas()
    assert np.shares_memory(frame["x"].to_numpy(), flight["x"])
    table = pyarrow.table(flight)
    [chunk] = table["x"].chunks
    assert chunk.buffers()[1].address == flight["x"].__array_interface__["data"][0]
    assert flight.to_polars()["q"].to_list() == flight["q"].tolist()
    assert polars.DataFrame(flight).columns == list(flight)


def test_a_model_predicts_what_it_was_fitted_to(flights, vehicle):
    found = quadlab.identify(vehicle=vehicle, train=flights[:3], validate=flights[3:])
    predicted = found.model.predict(flights[3])
    assert (np.diff(predicted["t"]) > 0).all()
    told = quadlab.compare(model=found.model, flights=flights[3])["total"]
    for axis in "uvwpqr":
        residual = predicted[axis] - predicted[f"{axis}_predicted"]
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(told[axis]["rms"], rel=1e-9)


def test_simulated_flights_are_those_of_their_seed(thesis_model):
    one, same, other = (quadlab.simulate(thesis_model, seed=seed, duration_s=3.0) for seed in (1, 1, 2))
    assert np.array_equal(one["x"], same["x"])
    assert not np.array_equal(one["x"], other["x"])
    still = quadlab.simulate(thesis_model, waypoints=[(0, 0, 0, -1, 0)], duration_s=5.0, noise=0.0, excitation=False)
    assert np.abs(still["x"]).max() < 0.02


def test_logs_of_other_programs_are_read():
    shared = pathlib.Path(os.environ.get("QUADLAB_SHARED_DATA", ""))
    logs = sorted(shared.glob("**/*.ulg"))[:3] if shared.name else []
    if not logs:
        pytest.skip("no logs of other programs are there")
    for log in logs:
        try:
            flights = quadlab.read_all(log)
        except quadlab.QuadlabError as told:
            assert log.name in str(told) and "\n" not in str(told)
            continue
        for flight in flights:
            assert flight.rows > 100 and (np.diff(flight["t"]) > 0).all()


def test_pictures_have_axes_with_units(flights, vehicle):
    figure = flights[0].plot()
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "position, m",
        "attitude, rad",
        "rates, rad/s",
        "command",
        "battery, V",
        "rotors, rad/s",
    ]
    found = quadlab.identify(vehicle=vehicle, train=flights[:3], validate=flights[3:])
    figure = plot.residuals(found.model, flights[3])
    assert figure.axes[-1].get_xlabel() == "time, s" and figure.axes[0].get_ylabel() == "u, m/s²"
    assert len(plot.coefficients(found).axes[0].patches) == len(found.frame("coefficients").dropna(subset=["std_error"]))
    assert len(flights[0].plot("theta").axes) == 1
    assert list(found.model.frame()["value"]) == list(found.frame("coefficients")["value"])


def test_flights_are_compared_cut_and_given_as_tables(flights, vehicle):
    assert flights[0] == quadlab.Flight(flights[0].columns) and flights[0] != flights[1] and flights[1] in flights
    part = flights[0].between(5.0, 10.0)
    assert part.rows == 501 and part["t"][0] == 5.0
    found = quadlab.identify(vehicle=vehicle, train=(one.to_pandas() for one in flights[:3]), validate=tuple(flights[3:4]))
    assert len(found["flights"]) == 4 and "flights" in found and "thrust" in repr(found)
    with pytest.raises(quadlab.QuadlabError, match="takes one flight, and 2 are given"):
        found.model.predict(flights[3:])
    with pytest.raises(quadlab.QuadlabError, match="is no table"):
        found.frame("vehicle")
    with pytest.raises(quadlab.QuadlabError, match="is a vehicle file, and this command needs a model"):
        quadlab.Model(vehicle)
    broken = quadlab.Flight({column: values for column, values in flights[0].columns.items() if column != "x"}, "broken.csv")
    with pytest.raises(quadlab.QuadlabError, match="^broken.csv: "):
        quadlab.identify(vehicle=vehicle, train=[broken, *flights[1:3]], validate=flights[3:])
