"""Errors in left-out blocks from sums of products, against row by row least squares."""

from __future__ import annotations

import numpy as np
import pytest
from observed import random_blocks, slow_squares, statistics_of

from excite.identification.choices.left_out import (
    NEGLIGIBLE,
    BlockStatistics,
    LeftOut,
    least_squares_of_products,
    left_out,
)
from regressors.errors import InputError
from regressors.samples import Array


def last_weights(statistics: BlockStatistics) -> tuple[LeftOut, Array]:
    """Left-out errors, and the weights of the estimates that they are of."""
    used: list[Array] = []

    def estimate(products: Array, weights: Array) -> Array:
        used.append(weights)
        return least_squares_of_products(products, weights)

    return left_out(statistics, estimate), used[-1]


@pytest.mark.parametrize("seed", range(6))
def test_squares_are_those_of_least_squares_on_the_rows_of_the_other_blocks(seed: int) -> None:
    W, y, block, _ = random_blocks(seed)
    statistics = statistics_of(W, y, block)
    found, weights = last_weights(statistics)
    floor = NEGLIGIBLE**2 * np.outer(statistics.counts / statistics.counts.sum(), (y[block >= 0] ** 2).sum(axis=0))
    np.testing.assert_allclose(found.squares, slow_squares(W, y, block, weights) + floor, rtol=1e-6)
    assert found.instants == np.count_nonzero(block >= 0)
    np.testing.assert_allclose(found.sizes, (y[block >= 0] ** 2).sum(axis=0))


def test_weights_are_the_inverse_mean_squares_of_the_errors_of_the_round_before() -> None:
    W, y, block, _ = random_blocks(1, noise=0.5)
    found, weights = last_weights(statistics_of(W, y, block))
    np.testing.assert_allclose(found.weights, found.instants / found.squares.sum(axis=0))
    np.testing.assert_allclose(found.weights, weights, rtol=0.11)


def test_statistics_are_sums_of_products_and_those_of_columns_are_parts_of_them() -> None:
    W, y, block, _ = random_blocks(2)
    statistics = statistics_of(W, y, block)
    both = np.concatenate([W, y[:, :, None]], axis=2)
    for number in range(5):
        for j in range(3):
            rows = both[block == number, j]
            np.testing.assert_allclose(statistics.products[number, j], rows.T @ rows)
    few = statistics_of(W[:, :, [2, 0]], y, block)
    np.testing.assert_allclose(statistics.of_columns([2, 0]).products, few.products)


def test_several_logs_give_the_blocks_of_all() -> None:
    W, y, block, _ = random_blocks(3)
    whole = statistics_of(W, y, block)
    cut = 2 * 60
    parts = BlockStatistics.of([W[:cut], W[cut:]], [y[:cut], y[cut:]], [block[:cut], block[cut:]])
    np.testing.assert_allclose(parts.products, whole.products)
    np.testing.assert_array_equal(parts.counts, whole.counts)


@pytest.mark.parametrize("block", [np.zeros(300, dtype=int), np.full(300, -1)], ids=["one", "none"])
def test_fewer_than_two_blocks_are_refused(block: Array) -> None:
    W, y, *_ = random_blocks(0)
    with pytest.raises(InputError, match="too few rows"):
        statistics_of(W, y, block)


# ---------------------------------------------------------------- scores


def test_score_error_and_weights_by_hand() -> None:
    found = LeftOut(np.array([[1.0, 16.0], [3.0, 48.0]]), 4, np.array([100.0, 1600.0]))
    assert found.score == pytest.approx((np.log(1.0) + np.log(4.0)) / 2)
    assert found.error == pytest.approx(np.sqrt(68 / 1700))
    assert found.weights.tolist() == [1.0, 1 / 16]


def test_gain_is_the_difference_of_scores_and_its_error_the_scatter_of_the_blocks() -> None:
    sizes = np.array([100.0])
    good = LeftOut(np.array([[1.0], [2.0], [1.0]]), 6, sizes)
    poor = LeftOut(np.array([[2.0], [4.0], [10.0]]), 6, sizes)
    gain, deviation = good.gain_over(poor)
    assert gain == pytest.approx(np.log(16 / 4) / 2)
    without = np.log([14 / 3, 12 / 2, 6 / 3]) / 2
    assert deviation == pytest.approx(np.sqrt(2 / 3 * np.sum((without - without.mean()) ** 2)))
    lost, same = poor.gain_over(good)
    assert (lost, same) == (-gain, deviation)


def test_a_gain_that_all_blocks_show_alike_is_certain() -> None:
    """However large it is, and however the blocks differ in size."""
    squares = np.array([[1.0, 4.0], [9.0, 2.0], [3.0, 3.0]])
    good, poor = LeftOut(squares, 6, np.ones(2)), LeftOut(400 * squares, 6, np.ones(2))
    assert good.gain_over(poor) == pytest.approx((np.log(20), 0.0), abs=1e-12)


def test_a_gain_that_one_block_shows_alone_is_uncertain() -> None:
    squares = np.ones((5, 1))
    poor = squares.copy()
    poor[2] = 1e4
    gain, deviation = LeftOut(squares, 5, np.ones(1)).gain_over(LeftOut(poor, 5, np.ones(1)))
    assert deviation > 0.75 * gain


def test_gains_of_repeated_experiments_scatter_as_one_of_them_says() -> None:
    W, _, block, beta = random_blocks(0, instants=400, blocks=8)
    sizes, gains, deviations = 3.0 ** np.arange(3), [], []
    for seed in range(60):
        y = W @ beta + 2.0 * sizes * np.random.default_rng(seed).normal(size=(400, 3))
        statistics = statistics_of(W, y, block)
        gain, deviation = left_out(statistics).gain_over(left_out(statistics.of_columns([0, 1, 2])))
        gains.append(gain)
        deviations.append(deviation)
    assert 0.7 < np.median(deviations) / np.std(gains) < 2.0  # the blocks' motions differ too


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_units_of_an_equation_change_no_gain(factor: float) -> None:
    W, y, block, _ = random_blocks(4)
    scale = np.array([1.0, factor, 1.0])
    plain, scaled = statistics_of(W, y, block), statistics_of(W * scale[:, None], y * scale, block)
    gain, deviation = left_out(plain).gain_over(left_out(plain.of_columns([0, 1, 2])))
    np.testing.assert_allclose(
        left_out(scaled).gain_over(left_out(scaled.of_columns([0, 1, 2]))), (gain, deviation), rtol=1e-6
    )


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_units_of_a_parameter_change_nothing(factor: float) -> None:
    W, y, block, _ = random_blocks(5)
    scaled = W * np.array([1.0, factor, 1.0, 1.0])
    np.testing.assert_allclose(
        left_out(statistics_of(scaled, y, block)).squares, left_out(statistics_of(W, y, block)).squares, rtol=1e-6
    )


# ---------------------------------------------------------------- edges


def test_negligible_errors_count_as_the_floor() -> None:
    W, y, block, _ = random_blocks(6, noise=0.0)
    found = left_out(statistics_of(W, y, block))
    assert found.error == pytest.approx(NEGLIGIBLE, rel=1e-2)
    less = left_out(statistics_of(W, y + 1e-9 * np.sin(np.arange(300.0))[:, None], block))
    gain, _ = found.gain_over(less)
    assert abs(gain) < 1e-3


def test_dependent_and_zero_columns_predict_as_well_as_without_them() -> None:
    W, y, block, _ = random_blocks(7)
    twice = np.concatenate([W, W[:, :, :2] @ np.array([[1.0], [2.0]]), np.zeros((300, 3, 1))], axis=2)
    np.testing.assert_allclose(
        left_out(statistics_of(twice, y, block)).squares, left_out(statistics_of(W, y, block)).squares, rtol=1e-4
    )


def test_a_column_that_only_one_block_shows_does_not_explode() -> None:
    W, y, block, _ = random_blocks(8)
    W[block != 4, :, 3] = 0.0
    y = W @ np.array([1.0, 1.0, 1.0, 0.0]) + 0.1 * np.random.default_rng(0).normal(size=y.shape)
    found = left_out(statistics_of(W, y, block))
    others = left_out(statistics_of(W[:, :, :3], y, block))
    assert found.error < 1.1 * others.error


def test_an_equation_without_any_torque_hinders_no_other() -> None:
    W, y, block, _ = random_blocks(9)
    silent_W, silent_y = W.copy(), y.copy()
    silent_W[:, 1], silent_y[:, 1] = 0.0, 0.0
    found = left_out(statistics_of(silent_W, silent_y, block))
    assert np.isfinite(found.score)
    rest = left_out(statistics_of(np.delete(W, 1, axis=1), np.delete(y, 1, axis=1), block))
    np.testing.assert_allclose(np.delete(found.squares, 1, axis=1), rest.squares, rtol=1e-6)
    assert np.isfinite(left_out(statistics_of(silent_W, 0 * y, block)).score)
