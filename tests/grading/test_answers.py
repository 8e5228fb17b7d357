"""Fields of pages: the error for a value that is not a number names the field, and numpy types are named as such."""

import numpy as np
import pytest

from snr_sim.grading.lab.answers import require_field
from snr_sim.grading.lab.verdicts import SubmissionError


@pytest.mark.parametrize("value", [np.float32(0.5), np.int64(3)])
def test_numpy_number_is_rejected_with_a_hint(value: object) -> None:
    with pytest.raises(SubmissionError) as caught:
        require_field({"right_px": value}, "target", "right_px", float)
    assert "number of numpy's" in caught.value.hint
    assert "float(...)" in caught.value.hint


def test_text_is_rejected_and_numpy_float64_accepted() -> None:
    with pytest.raises(SubmissionError) as caught:
        require_field({"right_px": "0.5"}, "target", "right_px", float)
    assert caught.value.hint == "'right_px' of the page 'target' is not a number."
    assert require_field({"right_px": np.float64(0.5)}, "target", "right_px", float) == 0.5
