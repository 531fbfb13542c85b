"""Environments of Gymnasium on the identified craft.

The craft is the one of software in the loop: the model's equations with its battery, the sensors' noise and delay, gusts and
faults. `QuadcopterEnv` is one craft, `QuadcopterVectorEnv` many in one call.
"""

from __future__ import annotations

import numbers
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from quadlab import _quadlab
from quadlab.running import Files, Model, Path

if TYPE_CHECKING:
    from typing_extensions import Unpack

class Options(TypedDict, total=False):
    """What an environment can be told; see `QuadcopterEnv`."""

    gains: Path | None
    action: Literal["motors", "attitude", "position"]
    observation: Literal["state", "sensors"]
    duration_s: float
    target_m: tuple[float, float, float]
    room_m: float
    start_m: float
    start_m_s: float
    start_rad: float
    delay_samples: int
    noise: float
    gusts: tuple[float, float] | None
    wind_m_s: tuple[float, float] | None
    motor_faults: Sequence[tuple[int, str, float, float]]


USUAL: Options = {
    "gains": None,
    "action": "motors",
    "observation": "state",
    "duration_s": 10.0,
    "target_m": (0.0, 0.0, -1.0),
    "room_m": 2.0,
    "start_m": 0.5,
    "start_m_s": 0.5,
    "start_rad": 0.2,
    "delay_samples": 2,
    "noise": 1.0,
    "gusts": None,
    "wind_m_s": None,
    "motor_faults": (),
}
"""What an environment is where it is not told."""


def _crafts(count: int, model: Model | Path, options: Options) -> _quadlab.Crafts:
    unknown = sorted(set(options) - set(USUAL))
    if unknown:
        raise _quadlab.QuadlabError(f"{unknown[0]}: is no option of an environment; choose from {', '.join(USUAL)}")
    wanted: dict[str, Any] = {**USUAL, **options}
    with Files() as files:
        wanted.update(model=files.model(model), motor_faults=list(wanted["motor_faults"]))
        return _quadlab.Crafts(wanted, count)


class QuadcopterEnv(gymnasium.Env):
    """A craft that is to reach a point and stay there.

    gains: a gains file for the flight law; the thesis' without.
    target_m: where to be, north, east, down. There is no floor.
    action: "motors" (commands over their range), "attitude" (roll and pitch up to 0.35 rad, yaw up to pi, height within the
        room) or "position" (north, east and down from the target within the room, yaw up to pi); four numbers from -1 to 1; one
        that is NaN counts as 0. The latter two go to the flight law, as its set points.
    observation: "state", 17 numbers: position from the target (north, east, down, m), velocity (m/s), attitude
        (quaternion w, x, y, z), rates (rad/s), and rotor speeds over those in hover. "sensors", 11 numbers: position
        from the target and attitude as the link delivers them, late and noisy, gyro (rad/s), and battery (V).
    duration_s: of an episode. room_m: the craft is lost farther than this from the target along any axis, or upside down.
    start_m, start_m_s, start_rad: how far, how fast and how tilted episodes start at most, along each axis.
    delay_samples, noise: of the poses; 1 is the noise of the thesis' laboratory.
    gusts: standard deviation (m/s) and correlation time (s). wind_m_s: steady wind, north and east.
    motor_faults: motor from 1, "dead", "weak" or "stuck", since when (s), and by how many command units where weak.

    The reward of a tick is minus its time times (distance² + 0.1 velocity² + 0.1 rates² + 0.01 action²), in SI units, and -100
    where the craft is lost.
    """

    metadata = {"render_modes": []}

    def __init__(self, model: Model | Path, **options: Unpack[Options]):
        self._crafts = _crafts(1, model, options)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self._crafts.numbers,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.period_s = self._crafts.period_s
        self._seen = np.zeros((1, self._crafts.numbers), np.float32)
        self._reward = np.zeros(1)
        self._ends = np.zeros((2, 1), np.bool_)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**63))
        self._crafts.reset([drawn], [True], self._seen)
        return self._seen[0].copy(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        actions = np.ascontiguousarray(action, np.float32).reshape(1, 4)
        self._crafts.step(actions, self._seen, self._reward, self._ends[0], self._ends[1], False)
        return self._seen[0].copy(), float(self._reward[0]), bool(self._ends[0, 0]), bool(self._ends[1, 0]), {}


class QuadcopterVectorEnv(VectorEnv):
    """Many craft of one model, each in an episode of its own; the options are those of `QuadcopterEnv`.

    One whose episode is over begins the next with the following step. `copy=False` gives the same arrays at every step.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, model: Model | Path, num_envs: int = 1, *, copy: bool = True, **options: Unpack[Options]):
        self.num_envs = num_envs
        self._copy = copy
        self._crafts = _crafts(num_envs, model, options)
        self.single_observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (self._crafts.numbers,), np.float32)
        self.single_action_space = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self.period_s = self._crafts.period_s
        self._seen = np.zeros((num_envs, self._crafts.numbers), np.float32)
        self._rewards = np.zeros(num_envs)
        self._ends = np.zeros((2, num_envs), np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        given = list(seed) if isinstance(seed, (list, tuple, np.ndarray)) else None
        super().reset(seed=int(seed) if isinstance(seed, numbers.Integral) else None)
        drawn = [int(one) for one in self.np_random.integers(2**63, size=self.num_envs)]
        if given:
            drawn = [one if own is None else int(own) for one, own in zip(drawn, given)]
        mask = np.ones(self.num_envs, np.bool_) if options is None else options.get("reset_mask", np.ones(self.num_envs))
        self._crafts.reset(drawn, [bool(one) for one in mask], self._seen)
        return self._taken(self._seen), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        actions = np.ascontiguousarray(actions, np.float32)
        self._crafts.step(actions, self._seen, self._rewards, self._ends[0], self._ends[1], True)
        ends = self._taken(self._ends)
        return self._taken(self._seen), self._taken(self._rewards), ends[0], ends[1], {}

    def _taken(self, array: np.ndarray) -> np.ndarray:
        return array.copy() if self._copy else array
