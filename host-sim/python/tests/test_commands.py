"""Commands as functions: what the program prints, as documents and models, and its errors in its words."""

import json
import logging
import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import quadlab


def test_a_model_is_identified_as_by_the_program(flights, vehicle, program, tmp_path):
    training, held_out = flights[:3], flights[3:]
    found = quadlab.identify(vehicle=vehicle, train=training, validate=held_out)
    names = []
    for flight in flights:
        names.append(tmp_path / flight.name)
        flight.save(names[-1])
    out = tmp_path / "model.toml"
    words = ["identify", "--json", "--vehicle", vehicle, "--out", out, "--train", *names[:3], "--validate", *names[3:]]
    printed = json.loads(subprocess.run([program, *words], check=True, capture_output=True).stdout)
    assert found.document["coefficients"] == printed["coefficients"]
    assert found.document["held_out"] == printed["held_out"]
    assert found.model.document["effect"] == quadlab.Model(out).document["effect"]
    table = found.frame("coefficients")
    assert list(table["effect"].unique()) == found.model.effects
    assert (table["std_error"] > 0).all()


def test_a_weight_is_found(flights, vehicle, thesis_model):
    document = pathlib.Path(thesis_model).read_text()
    weight = '\n[[effect]]\nid = "mass-change"\ncoefficient = [{ name = "extra_mass", value = 0.08, unit = "kg" }]\n'
    heavy = quadlab.Model.from_text(document + weight)
    heavy_flights = [quadlab.simulate(heavy, seed=seed, duration_s=24.0) for seed in (11, 12)]
    usual = quadlab.identify(vehicle=vehicle, train=flights[:3], validate=flights[3:]).model
    found = quadlab.changed(usual, heavy_flights)
    assert found.document["verdict"] == "missing-effect"
    assert found.document["effects"][0]["effect"] == "mass-change"
    [mass] = found.document["effects"][0]["coefficients"]
    assert abs(mass["value"] - 0.08) < 0.001


def test_mistakes_are_the_program_s_own_sentences(flights, vehicle, tmp_path):
    with pytest.raises(quadlab.QuadlabError, match="nowhere.csv.*No such file|nowhere.csv") as told:
        quadlab.identify(vehicle=vehicle, train=[tmp_path / "nowhere.csv"], validate=flights[3:])
    assert "\n" not in str(told.value)
    with pytest.raises(quadlab.QuadlabError, match=r"possible values: moments, all"):
        quadlab.identify(vehicle=vehicle, train=flights[:3], validate=flights[3:], refine="nonsense")
    out = tmp_path / "model.toml"
    out.write_text("mine")
    with pytest.raises(quadlab.QuadlabError, match="already exists; give --force"):
        quadlab.identify(vehicle=vehicle, train=flights[:3], validate=flights[3:], out=out)
    assert out.read_text() == "mine"
    with pytest.raises(quadlab.QuadlabError, match="differ in length"):
        quadlab.Flight({"t": [0.0, 1.0], "x": [0.0]})


def test_notes_and_warnings_go_to_the_logger(flights, vehicle, caplog):
    with caplog.at_level(logging.INFO, logger="quadlab"):
        quadlab.identify(flights, vehicle=vehicle)
    [note] = [record for record in caplog.records if record.name == "quadlab" and record.levelno == logging.INFO]
    assert note.getMessage().startswith("split: fitted on ")


def test_other_threads_go_on_while_it_computes(flights, vehicle):
    counted, ends = [0], threading.Event()

    def count():
        while not ends.is_set():
            counted[0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    quadlab.explain(vehicle=vehicle, train=flights[:3], validate=flights[3:])
    ends.set()
    counter.join()
    assert counted[0] > 20


def test_control_c_stops_it(flights, vehicle, tmp_path):
    for k, flight in enumerate(flights):
        flight.save(tmp_path / f"{k}.csv")
    names = [str(tmp_path / f"{k}.csv") for k in range(5)]
    script = f"""
import sys, quadlab
print("begins", flush=True)
try:
    while True:
        quadlab.discover(vehicle={str(vehicle)!r}, train={names[:3]!r}, validate={names[3:]!r})
except KeyboardInterrupt:
    print("stopped", flush=True)
"""
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begins\n"
    time.sleep(1.0)
    child.send_signal(signal.SIGINT)
    assert child.communicate(timeout=60)[0] == "stopped\n"
    assert child.returncode == 0


def test_a_law_is_designed_and_checked(thesis_model, tmp_path):
    gains = tmp_path / "gains.toml"
    quadlab.design(model=thesis_model, out=gains)
    checked = quadlab.design_check(model=thesis_model, gains=gains)
    assert checked.holds
    flown = quadlab.simulate(thesis_model, gains=gains, waypoints=[(0, 0, 0, -1, 0), (1, 0.5, 0, -1, 0)], duration_s=20.0, noise=0.0, excitation=False)
    assert abs(flown["x"][-1] - 0.5) < 0.05
