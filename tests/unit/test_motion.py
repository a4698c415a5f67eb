"""The process model: stationarity, composition of steps, and its dense form."""

import numpy as np
import pytest

from graspdb_ingest.hand.posture import default_prior
from graspdb_ingest.parameters import TrackingParameters
from graspdb_ingest.tracking.algebra import predicted_covariance, predicted_mean
from graspdb_ingest.tracking.motion import MotionNoise, from_blocks, motion_model, to_blocks
from graspdb_schemas.vocabulary import JOINT_ANGLES, N_DOF, Side

FREE = 6
JOINTS = np.r_[FREE:N_DOF, N_DOF + FREE : 2 * N_DOF]


@pytest.fixture(scope="module")
def prior(hands):
    return default_prior(hands[Side.RIGHT])


@pytest.fixture(scope="module")
def model_of(hands, prior):
    return lambda step: motion_model(
        hands[Side.RIGHT], prior, MotionNoise.assumed(TrackingParameters()), step
    )


def dense(model):
    """Return A, for which the state after a step is A x + w."""
    return np.block(
        [
            [np.diag(model.transition[0]), np.diag(model.transition[1])],
            [np.diag(model.transition[2]), np.diag(model.transition[3])],
        ]
    )


def after_step(model, covariance):
    blocks = to_blocks(covariance)
    return from_blocks(predicted_covariance(blocks, model.transition, model.noise_blocks, np.ones(N_DOF)))


def random_covariance(rng):
    root = rng.normal(size=(2 * N_DOF, 2 * N_DOF))
    return root @ root.T / (2 * N_DOF)


def test_prior_is_a_covariance_with_its_means_within_the_limits(hands, prior):
    assert prior.mean.shape == (len(JOINT_ANGLES),)
    assert np.array_equal(prior.covariance, prior.covariance.T)
    assert np.linalg.eigvalsh(prior.covariance).min() > 0
    limits = hands[Side.RIGHT].joint_range
    assert np.all((prior.mean > limits[:, 0]) & (prior.mean < limits[:, 1]))


def test_predicted_covariance_is_the_dense_product(model_of):
    model, rng = model_of(1 / 120), np.random.default_rng(1)
    covariance = random_covariance(rng)
    a = dense(model)
    assert np.allclose(
        after_step(model, covariance),
        a @ covariance @ a.T + model.noise,
        atol=1e-12,
    )


def test_predicted_mean_is_the_dense_product(model_of):
    model, rng = model_of(1 / 120), np.random.default_rng(2)
    offset, velocity = rng.normal(size=(2, N_DOF))
    after = dense(model) @ np.concatenate([offset, velocity])
    change, new_velocity = predicted_mean(offset, velocity, model.transition)
    assert np.allclose(change, after[:N_DOF] - offset, atol=1e-12)
    assert np.allclose(new_velocity, after[N_DOF:], atol=1e-12)


def test_noise_is_a_covariance(model_of):
    for step in (1 / 1000, 1 / 120, 0.5):
        noise = model_of(step).noise
        assert np.array_equal(noise, noise.T)
        scale = np.sqrt(np.diagonal(noise))
        assert np.linalg.eigvalsh(noise / np.outer(scale, scale)).min() > 0


def test_two_half_steps_are_one_step(model_of):
    whole, half = model_of(0.02), model_of(0.01)
    a = dense(half)
    assert np.allclose(a @ a, dense(whole), atol=1e-12)
    scale = np.sqrt(np.diagonal(whole.noise))
    assert np.allclose(
        (a @ half.noise @ a.T + half.noise - whole.noise) / np.outer(scale, scale), 0, atol=1e-9
    )


def test_joints_left_alone_return_to_the_prior_and_its_spread(model_of, prior):
    model = model_of(1 / 120)
    covariance = np.zeros((2 * N_DOF, 2 * N_DOF))
    offset, velocity = np.full(N_DOF, 0.5), np.full(N_DOF, 2.0)
    for _ in range(5 * 120):
        covariance = after_step(model, covariance)
        change, velocity = predicted_mean(offset, velocity, model.transition)
        offset = offset + change
    joints = covariance[FREE:N_DOF, FREE:N_DOF]
    spread = np.sqrt(np.diagonal(prior.covariance))
    assert np.allclose((joints - prior.covariance) / np.outer(spread, spread), 0, atol=1e-6)
    assert np.allclose(offset[FREE:], 0, atol=1e-6)
    assert np.allclose(velocity[FREE:], 0, atol=1e-6)


def test_stationary_covariance_of_the_joints_stays(model_of):
    model = model_of(1 / 50)
    after = after_step(model, model.stationary)
    assert np.allclose(after[np.ix_(JOINTS, JOINTS)], model.stationary[np.ix_(JOINTS, JOINTS)], atol=1e-10)


def test_half_of_the_way_back_takes_the_time_scale_that_matern_says(model_of):
    time = TrackingParameters().posture_time
    change, _ = predicted_mean(np.ones(N_DOF), np.zeros(N_DOF), model_of(time).transition)
    assert np.allclose(1 + change[FREE:], 2 / np.e)  # correlation (1 + t / T) exp(-t / T) at t = T


def test_free_joint_keeps_its_velocity_and_forgets_at_the_given_rate(model_of):
    step, parameters = 0.01, TrackingParameters()
    model = model_of(step)
    rng = np.random.default_rng(3)
    velocity = rng.normal(size=N_DOF)
    change, after = predicted_mean(rng.normal(size=N_DOF), velocity, model.transition)
    assert np.allclose(change[:FREE], step * velocity[:FREE])
    assert np.array_equal(after[:FREE], velocity[:FREE])
    covariance = np.zeros((2 * N_DOF, 2 * N_DOF))
    for _ in range(200):
        covariance = after_step(model, covariance)
    density = np.repeat([parameters.translation_acceleration**2, parameters.rotation_acceleration**2], 3)
    elapsed = 200 * step
    assert np.allclose(np.diagonal(covariance)[:FREE], density * elapsed**3 / 3)
    assert np.allclose(np.diagonal(covariance)[N_DOF : N_DOF + FREE], density * elapsed)
