"""What the tests share: the thesis' craft, and flights of it."""

import os
import pathlib

import matplotlib
import pytest

import quadlab

matplotlib.use("Agg")
VEHICLES = pathlib.Path(__file__).parents[2] / "model/vehicles"


@pytest.fixture(scope="session")
def vehicle():
    return VEHICLES / "f330.toml"


@pytest.fixture(scope="session")
def thesis_model():
    return VEHICLES / "f330-model.toml"


@pytest.fixture(scope="session")
def program():
    return os.environ["QUADLAB_PROGRAM"]


@pytest.fixture(scope="session")
def flights(thesis_model):
    flown = [quadlab.simulate(thesis_model, seed=seed, duration_s=24.0) for seed in range(5)]
    for seed, flight in enumerate(flown):
        flight.name = f"{seed}.csv"
    return flown
