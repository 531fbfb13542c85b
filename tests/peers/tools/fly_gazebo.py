"""Accelerations of an exported craft as Gazebo would compute them: fly_gazebo.py CRAFT.sdf CASES.json

Drake reads the file (with libsdformat, Gazebo's own parser) and has the rigid bodies; the forces of Gazebo's motor model, which is not
Drake's, are put on the links as gz-sim's MulticopterMotorModel puts them. Prints JSON. Axes are north, west, up and forward, left, up.
"""

import json
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
from pydrake.math import RigidTransform
from pydrake.common.eigen_geometry import Quaternion
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.common.value import Value

cases = json.load(open(sys.argv[2]))
plant = MultibodyPlant(time_step=0.0)
# What Drake does not know of the file (Gazebo's plugins) is a warning of its own.
# Gazebo holds the speed of the rotors against the craft, so that they turn with it.
text = open(sys.argv[1]).read().replace('type="revolute"', 'type="fixed"')
Parser(plant).AddModelsFromString(text, "sdf")
plant.mutable_gravity_field().set_gravity_vector([0, 0, -cases["gravity"]])
plant.Finalize()
motors = [
    {child.tag: child.text for child in plugin}
    for plugin in ElementTree.parse(sys.argv[1]).getroot().iter("plugin")
]
craft = plant.GetBodyByName("craft")


def force(body, where_b, moment, push):
    """A force in world axes at a place of a body."""
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = body.index()
    applied.p_BoBq_B = where_b
    applied.F_Bq_W = SpatialForce(moment, push)
    return applied


def of_motor(context, motor, speed):
    number = lambda tag: float(motor[tag])
    link = plant.GetBodyByName(motor["linkName"])
    pose = plant.EvalBodyPoseInWorld(context, link)
    axis = pose.rotation().matrix()[:, 2]
    velocity = plant.EvalBodySpatialVelocityInWorld(context, link).translational()
    across = velocity - velocity.dot(axis) * axis
    thrust = speed**2 * number("motorConstant")
    direction = {"ccw": 1.0, "cw": -1.0}[motor["turningDirection"]]
    push = thrust * axis - abs(speed) * number("rotorDragCoefficient") * across
    torque = -direction * thrust * number("momentConstant") * axis
    return [force(link, np.zeros(3), np.zeros(3), push), force(craft, np.zeros(3), torque, np.zeros(3))]


def accelerations(state):
    context = plant.CreateDefaultContext()
    w, x, y, z = state["attitude"]
    pose = RigidTransform(Quaternion(np.array([w, x, y, z]) / np.linalg.norm(state["attitude"])), state["position"])
    plant.SetFreeBodyPose(context, craft, pose)
    rotation = pose.rotation().matrix()
    before = SpatialVelocity(rotation @ np.array(state["rates"]), np.array(state["velocity"]))
    plant.SetFreeBodySpatialVelocity(craft, before, context)
    forces = [f for motor, speed in zip(motors, state["rotors"]) for f in of_motor(context, motor, speed)]
    plant.get_applied_spatial_force_input_port().FixValue(context, Value[list[ExternallyAppliedSpatialForce]](forces))
    # Turning and translation of the craft's link, in world axes.
    change = plant.EvalTimeDerivatives(context).CopyToVector()[-6:]
    return np.concatenate([change[3:], rotation.T @ change[:3]]).tolist()


context = plant.CreateDefaultContext()
inertia = plant.CalcSpatialInertia(
    context, craft.body_frame(), [plant.GetBodyByName(motor["linkName"]).index() for motor in motors] + [craft.index()]
)
json.dump(
    {
        "accelerations": [accelerations(state) for state in cases["states"]],
        "mass": inertia.get_mass(),
        "center": inertia.get_com().tolist(),
        "inertia": inertia.CalcRotationalInertia().CopyToFullMatrix3().tolist(),
        "lag": [float(motor["timeConstantUp"]) for motor in motors],
    },
    sys.stdout,
)
