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


class _Many:
    """Craft, what environments say of them, and the arrays that they fill."""

    def __init__(self, count: int, model: Model | Path, options: Options):
        unknown = sorted(set(options) - set(USUAL))
        if unknown:
            raise _quadlab.QuadlabError(f"{unknown[0]}: is no option of an environment; choose from {', '.join(USUAL)}")
        wanted: dict[str, Any] = {**USUAL, **options}
        with Files() as files:
            wanted.update(model=files.model(model), motor_faults=list(wanted["motor_faults"]))
            self.crafts = _quadlab.Crafts(wanted, count)
        numbers = self.crafts.numbers
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (numbers,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.seen = np.zeros((count, numbers), np.float32)
        self.rewards = np.zeros(count)
        self.ends = np.zeros((2, count), np.bool_)

    def step(self, actions: np.ndarray, autoreset: bool) -> None:
        actions = np.ascontiguousarray(actions, np.float32)
        self.crafts.step(actions, self.seen, self.rewards, self.ends[0], self.ends[1], autoreset)


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
        self._one = _Many(1, model, options)
        self.observation_space = self._one.observation_space
        self.action_space = self._one.action_space
        self.period_s = self._one.crafts.period_s

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**63))
        self._one.crafts.reset([drawn], [True], self._one.seen)
        return self._one.seen[0].copy(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        one = self._one
        one.step(np.reshape(action, (1, 4)), False)
        return one.seen[0].copy(), float(one.rewards[0]), bool(one.ends[0, 0]), bool(one.ends[1, 0]), {}


class QuadcopterVectorEnv(VectorEnv):
    """Many craft of one model, each in an episode of its own; the options are those of `QuadcopterEnv`.

    One whose episode is over begins the next with the following step. `copy=False` gives the same arrays at every step.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, model: Model | Path, num_envs: int = 1, *, copy: bool = True, **options: Unpack[Options]):
        self.num_envs = num_envs
        self._copy = copy
        self._many = _Many(num_envs, model, options)
        self.single_observation_space = self._many.observation_space
        self.single_action_space = self._many.action_space
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, num_envs)
        self.period_s = self._many.crafts.period_s

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        given = list(seed) if isinstance(seed, (list, tuple, np.ndarray)) else None
        super().reset(seed=int(seed) if isinstance(seed, numbers.Integral) else None)
        drawn = [int(one) for one in self.np_random.integers(2**63, size=self.num_envs)]
        if given:
            drawn = [one if own is None else int(own) for one, own in zip(drawn, given)]
        mask = np.ones(self.num_envs, np.bool_) if options is None else options.get("reset_mask", np.ones(self.num_envs))
        self._many.crafts.reset(drawn, [bool(one) for one in mask], self._many.seen)
        return self._taken(self._many.seen), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        many = self._many
        many.step(actions, True)
        ends = self._taken(many.ends)
        return self._taken(many.seen), self._taken(many.rewards), ends[0], ends[1], {}

    def _taken(self, array: np.ndarray) -> np.ndarray:
        return array.copy() if self._copy else array
