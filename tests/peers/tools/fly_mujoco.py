"""Fly an exported craft in MuJoCo: fly_mujoco.py CRAFT.xml CASES.json

Prints accelerations at given states, and the states at the end of flights, as JSON. Axes are north, west, up and forward, left, up.
"""

import json
import sys

import mujoco
import numpy as np

model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
cases = json.load(open(sys.argv[2]))


def put(state):
    mujoco.mj_resetData(model, data)
    data.qpos[:3] = state["position"]
    data.qpos[3:7] = state["attitude"]
    data.qvel[:3] = state["velocity"]
    data.qvel[3:6] = state["rates"]
    data.ctrl[:] = state["thrust"]
    if model.na:
        data.act[:] = state.get("thrust_now", state["thrust"])


def accelerations(state):
    put(state)
    mujoco.mj_forward(model, data)
    return data.qacc[:6].tolist()


def fly(flight):
    put(flight)
    for _ in range(round(flight["duration_s"] / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos[:7], data.qvel[:6]]).tolist()


def in_hover():
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    mujoco.mj_forward(model, data)
    return data.qacc[:6].tolist()


json.dump(
    {
        "accelerations": [accelerations(state) for state in cases["states"]],
        "flights": [fly(flight) for flight in cases["flights"]],
        "hover": in_hover(),
    },
    sys.stdout,
)
