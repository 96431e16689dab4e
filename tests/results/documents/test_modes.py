"""Documents of modes."""

import numpy as np

import sprung
from sprung.results.documents import (
    identification_document,
    mode_documents,
)


def test_modes_of_a_document_are_those_of_the_identification(identification, tmp_path) -> None:
    sprung.write_identification(identification, tmp_path / "modes.json")
    modes = sprung.read_identification(tmp_path / "modes.json").as_modes()
    np.testing.assert_allclose(modes.poles, identification.modes.poles, rtol=1e-12)
    np.testing.assert_array_equal(modes.mode_shapes, identification.modes.mode_shapes)
    np.testing.assert_array_equal(modes.damping_ratio_std, identification.modes.damping_ratio_std)
    assert (modes.labels, modes.channels) == (identification.modes.labels, identification.modes.channels)


def test_modes_alone_are_those_of_a_subset(identification, plain) -> None:
    subset = identification.subsets[0]
    written = plain(identification_document(identification))
    assert mode_documents(subset.modes) == written["subsets"][0]["modes"]
