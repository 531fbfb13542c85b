"""Responses of an exported linear model in python-control: respond_control.py CRAFT.py CASES.json

Prints the poles of the plant, the frequency responses of its channels, and what small steps of an input become, as JSON.
"""

import json
import runpy
import sys

import control
import numpy as np

made = runpy.run_path(sys.argv[1])
plant, channels = made["plant"], made["channels"]
cases = json.load(open(sys.argv[2]))


def pair(value):
    return [float(np.real(value)), float(np.imag(value))]


def step(case):
    column = made["inputs"].index(case["input"])
    row = made["states"].index(case["output"])
    loop = case["size"] * made["plant_with_rotors"][row, column]
    time = np.linspace(0.0, case["duration_s"], 201)
    return float(control.step_response(loop, T=time).outputs[-1])


json.dump(
    {
        "poles": [pair(pole) for pole in np.linalg.eigvals(plant.A)],
        "channels": {
            name: [pair(channel(1j * frequency)) for frequency in cases["frequencies_rad_s"]] for name, channel in channels.items()
        },
        "steps": [step(case) for case in cases["steps"]],
    },
    sys.stdout,
)
