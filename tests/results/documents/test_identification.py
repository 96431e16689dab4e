"""Documents of modes and identifications."""

import numpy as np

import sprung
from sprung.results.documents import identification_document


def test_harmonics_have_the_unit_of_their_kind(identification, plain) -> None:
    from dataclasses import replace

    lines = (
        sprung.Harmonic(17.0, "constant", (16.9, 17.1), 0.1, 20.0, ("acc_1",)),
        sprung.Harmonic(0.5, "speed", (4.0, 9.0), 0.01, 12.0, ("acc_1", "acc_2"), 0.25, 2),
    )
    document = identification_document(replace(identification, harmonics=lines))
    written = plain(document)["harmonics"]
    assert [line["unit"] for line in written] == ["Hz", "1/m"]
    assert list(written[0])[-1] == "unit"
    assert identification_document(replace(identification, harmonics=document.harmonics)).harmonics == lines


def test_modes_of_a_document_are_those_of_the_identification(identification, tmp_path) -> None:
    sprung.write_identification(identification, tmp_path / "modes.json")
    modes = sprung.read_identification(tmp_path / "modes.json").as_modes()
    np.testing.assert_allclose(modes.poles, identification.modes.poles, rtol=1e-12)
    np.testing.assert_array_equal(modes.mode_shapes, identification.modes.mode_shapes)
    np.testing.assert_array_equal(modes.damping_ratio_std, identification.modes.damping_ratio_std)
    assert (modes.labels, modes.channels) == (identification.modes.labels, identification.modes.channels)
