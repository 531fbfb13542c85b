"""Environments on the identified craft."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import quadlab
from quadlab.learning import QuadcopterEnv, QuadcopterVectorEnv


@pytest.mark.parametrize("action", ["motors", "attitude", "position"])
@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.filterwarnings("ignore:.*A Box observation space")
def test_gymnasium_finds_nothing_wrong(thesis_model, action, observation):
    check_env(QuadcopterEnv(thesis_model, action=action, observation=observation), skip_render_check=True)


def test_the_law_holds_the_target_and_idle_motors_do_not(thesis_model):
    held = QuadcopterEnv(thesis_model, action="position")
    held.reset(seed=1)
    for _ in range(1000):
        seen, _, terminated, truncated, _ = held.step(np.zeros(4, np.float32))
    assert truncated and not terminated
    assert np.linalg.norm(seen[:3]) < 0.15
    idle = QuadcopterEnv(thesis_model, action="motors")
    idle.reset(seed=1)
    rewards = [idle.step(-np.ones(4, np.float32)) for _ in range(120)]
    assert any(terminated for _, _, terminated, _, _ in rewards)
    assert min(reward for _, reward, _, _, _ in rewards) == -100.0


def test_many_craft_fly_as_each_alone(thesis_model):
    options = dict(action="attitude", gusts=(0.5, 2.0), noise=1.0, duration_s=1.0)
    many = QuadcopterVectorEnv(thesis_model, 5, **options)
    one = QuadcopterVectorEnv(thesis_model, 1, **options)
    actions = np.random.default_rng(3).uniform(-1, 1, (150, 5, 4)).astype(np.float32)
    together = [many.reset(seed=[10, 11, 12, 13, 14])[0]]
    results = [many.step(action) for action in actions]
    together += [seen for seen, *_ in results]
    assert any(ends.any() for _, _, _, ends, _ in results), "an episode of a second ends within 150 ticks"
    for k in range(5):
        alone = [one.reset(seed=[10 + k])[0]] + [one.step(action[k : k + 1])[0] for action in actions]
        assert all(np.array_equal(seen[k], own[0]) for seen, own in zip(together, alone))


def test_faults_and_wrong_tasks(thesis_model):
    broken = QuadcopterEnv(thesis_model, action="position", motor_faults=[(2, "dead", 0.5, 0.0)])
    broken.reset(seed=1)
    assert any(broken.step(np.zeros(4, np.float32))[2] for _ in range(500))
    for options, told in [
        (dict(action="rudder"), "expected motors, attitude or position"),
        (dict(observation="all"), "expected state or sensors"),
        (dict(motor_faults=[(5, "dead", 0.0, 0.0)]), "motor 5, expected 1 to 4"),
        (dict(duration_s=-1.0), "duration_s"),
        (dict(speed=1.0), "speed: is no option of an environment; choose from gains, action"),
    ]:
        with pytest.raises(quadlab.QuadlabError, match=told):
            QuadcopterEnv(thesis_model, **options)
    vector = QuadcopterVectorEnv(thesis_model, 3)
    assert np.array_equal(vector.reset(seed=np.int64(3))[0], vector.reset(seed=3)[0])
    with pytest.raises(ValueError, match="expected \\(3, 4\\)"):
        vector.step(np.zeros((2, 4), np.float32))


def test_a_random_policy_is_judged_worse_than_the_law(thesis_model):
    def mean_return(action, policy):
        vector = QuadcopterVectorEnv(thesis_model, 32, action=action, duration_s=3.0)
        vector.reset(seed=5)
        total = np.zeros(32)
        over = np.zeros(32, bool)
        for _ in range(300):
            _, rewards, terminated, truncated, _ = vector.step(policy(vector))
            total += np.where(over, 0.0, rewards)
            over |= terminated | truncated
        return total.mean()

    law = mean_return("position", lambda _: np.zeros((32, 4), np.float32))
    chance = mean_return("motors", lambda vector: vector.action_space.sample())
    assert law > -5.0 > chance
