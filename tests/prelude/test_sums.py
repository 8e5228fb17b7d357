from fractions import Fraction

from snr_sim.prelude.sums import dot_product, ordered_sum

# Compensated as since Python 3.12, the sum is 1.0 and 2.0.
TENTHS, LOST = [0.1] * 10, [1e16, 1.0, 1.0, -1e16]


def test_ordered_sum_rounds_after_each_addition() -> None:
    assert ordered_sum(TENTHS) == 0.9999999999999999
    assert ordered_sum(LOST) == 0.0
    assert ordered_sum([]) == 0.0


def test_dot_product_rounds_after_each_addition() -> None:
    assert dot_product(LOST, [1.0] * 4) == 0.0
    assert float(sum(map(Fraction, LOST))) == 2.0
