"""Losses in messages: their form is checked, and an older box states none."""

import pytest

from sprung.errors import FormatError
from sprung.link import MAX_LOSSES, Loss, losses_in, span_of


def test_losses_are_read_as_they_are_written() -> None:
    losses = [Loss(1, 0, 4, 5, 10, 20), Loss(2, 3, 3, 1)]
    assert losses_in({"lost": [list(loss) for loss in losses]}) == losses
    assert losses_in({}) == []
    assert span_of(losses) == (10, 20)
    assert span_of([]) == (0, 0)


@pytest.mark.parametrize(
    "lost",
    [
        5,
        [5],
        [[1, 0, 4, 5, 10]],
        [[1, 0, 4, 5, 10, 20.0]],
        [[1, 4, 0, 5, 10, 20]],
        [[1, 0, 4, 5, 10, -1]],
        [[2**63, 0, 4, 5, 10, 20]],
        [[True, 0, 4, 5, 10, 20]],
        [[1, 0, 4, 5, 10, 20]] * (MAX_LOSSES + 1),
    ],
)
def test_losses_of_another_form_are_refused(lost) -> None:
    with pytest.raises(FormatError, match=r"lost frames"):
        losses_in({"lost": lost})
