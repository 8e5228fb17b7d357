"""Fields of pages: the error for a value that is not a number names the field, and numpy types are named as such."""

import numpy as np
import pytest

from snr_sim.grading.lab.fields import field_of
from snr_sim.grading.lab.verdicts import Misbehaved


@pytest.mark.parametrize("value", [np.float32(0.5), np.int64(3)])
def test_a_number_of_numpys_alone_is_told_as_one(value: object) -> None:
    with pytest.raises(Misbehaved) as caught:
        field_of({"right_px": value}, "target", "right_px", float)
    assert "number of numpy's" in caught.value.hint
    assert "float(...)" in caught.value.hint


def test_a_text_is_no_number_and_a_number_of_numpys_that_is_pythons_too_will_do() -> None:
    with pytest.raises(Misbehaved) as caught:
        field_of({"right_px": "0.5"}, "target", "right_px", float)
    assert caught.value.hint == "'right_px' of the page 'target' is not a number."
    assert field_of({"right_px": np.float64(0.5)}, "target", "right_px", float) == 0.5
