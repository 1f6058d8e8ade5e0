"""The keyed permutation: one to one, the same for ever, and no order to be seen in it."""

import numpy as np
import pytest

import touchstone
from touchstone import Permutation


@pytest.mark.parametrize("size", [0, 1, 2, 3, 4, 5, 16, 17, 255, 256, 257, 1000, 65537])
def test_every_number_comes_once(size):
    order = Permutation(size, seed=3)
    assert sorted(order) == list(range(size))
    assert len(order) == size


def test_the_way_back_leads_back():
    order = Permutation(10_007, seed=1, epoch=4)
    places = np.arange(len(order))
    assert np.array_equal(order.place_of(order[places]), places)
    assert order.place_of(order[77]) == 77


def test_a_place_is_computed_without_the_others():
    order = Permutation(10**15, seed=9)
    places = np.array([0, 1, 123456789012345, 10**15 - 1])
    assert np.array_equal(order.place_of(order[places]), places)
    assert order[-1] == order[10**15 - 1]


def test_it_is_the_same_for_ever():
    # Whoever resumes next year meets this order.
    assert list(Permutation(10, seed=1)) == [7, 2, 3, 8, 1, 5, 6, 4, 9, 0]
    assert Permutation(10**12, seed=7, epoch=2)[np.arange(3)].tolist() == [616448578079, 523734964117, 658612737170]


def test_seeds_and_epochs_give_orders_of_their_own():
    orders = {tuple(Permutation(50, seed, epoch)) for seed in range(20) for epoch in range(20)}
    assert len(orders) == 400


def test_numbers_fall_on_every_place_equally_often():
    # Of 8 numbers over 4000 orders: 64 counts of 500 each on average; their chi square has 49 degrees of freedom.
    counts = np.zeros((8, 8))
    for epoch in range(4000):
        counts[np.arange(8), Permutation(8, 5, epoch)[np.arange(8)]] += 1
    assert ((counts - 500) ** 2 / 500).sum() < 100  # beyond that once in 30,000 such tests


def test_neighbours_do_not_stay_neighbours():
    order = Permutation(100_000, seed=2)[np.arange(100_000)]
    # A random order has as many rises as falls, and its places do not go with its numbers.
    assert abs((np.diff(order) > 0).mean() - 0.5) < 0.005
    assert abs(np.corrcoef(order, np.arange(100_000))[0, 1]) < 0.015


def test_places_beyond_the_end_are_refused():
    order = Permutation(10)
    with pytest.raises(IndexError, match="place 10 of 10"):
        order[10]
    with pytest.raises(IndexError):
        order[np.array([3, 10])]
    with pytest.raises(touchstone.InvalidRequest, match="size is -1"):
        Permutation(-1)
