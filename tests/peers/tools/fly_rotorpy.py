"""Fly an exported craft in rotorpy: fly_rotorpy.py CRAFT.py CASES.json

Prints accelerations at given states, and the states at the end of flights, as JSON. Axes are north, west, up and forward, left, up.
"""

import json
import runpy
import sys

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor

cases = json.load(open(sys.argv[2]))
craft = Multirotor(runpy.run_path(sys.argv[1])["quad_params"], integrator_kwargs={"method": "RK45", "rtol": 1e-10, "atol": 1e-12})


def state_of(state):
    w, x, y, z = state["attitude"]
    return {
        "x": np.array(state["position"]),
        "v": np.array(state["velocity"]),
        "q": np.array([x, y, z, w]),
        "w": np.array(state["rates"]),
        "wind": np.zeros(3),
        "rotor_speeds": np.array(state["rotors"]),
    }


def accelerations(state):
    found = craft.statedot(state_of(state), {"cmd_motor_speeds": np.array(state["rotors"])}, 0.0)
    return np.concatenate([found["vdot"], found["wdot"]]).tolist()


def fly(flight):
    state, step_s = state_of(flight), 0.01
    for _ in range(round(flight["duration_s"] / step_s)):
        state = craft.step(state, {"cmd_motor_speeds": np.array(flight["commanded"])}, step_s)
    x, y, z, w = state["q"]
    return np.concatenate([state["x"], [w, x, y, z], state["v"], state["w"]]).tolist()


json.dump(
    {"accelerations": [accelerations(state) for state in cases["states"]], "flights": [fly(f) for f in cases["flights"]]},
    sys.stdout,
)
