"""Documents of modes and identifications."""

import numpy as np
import pytest

import sprung
from sprung.results.documents import (
    identification_document,
    mode_documents,
)


def test_an_identification_is_read_as_it_was_written(identification, plain, tmp_path) -> None:
    sprung.write_identification(identification, tmp_path / "modes.json")
    document = sprung.read_identification(tmp_path / "modes.json")
    written = plain(identification_document(identification))
    assert plain(document) == written
    assert sprung.read_document(tmp_path / "modes.json").as_json() == written
    assert written["settings"]["lifter"] == {"kind": "ShortPass", "length": 2.0}
    for mode, members in zip(written["modes"], identification.members.tolist(), strict=True):
        for values, subset, member in zip(mode["subsets"], identification.subsets, members, strict=True):
            if member < 0:
                assert values is None
            else:
                assert values["stable_rate"] == pytest.approx(subset.modes.stable_rate[member])


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


def test_set_ups_are_read_as_they_were_written(plain, tmp_path) -> None:
    from sprung.simulation import simulate, usual_excitation
    from sprung.vehicles import read_description, structure

    chain = structure(read_description("chain3"))
    runs = [
        simulate(chain, usual_excitation(chain), duration=60.0, sampling_rate=200.0, seed=seed).select(names)
        for seed, names in enumerate((["acc_1", "acc_2"], ["acc_1", "acc_3"]))
    ]
    identification = sprung.cov_ssi(runs)
    sprung.write_identification(identification, tmp_path / "modes.json")
    document = sprung.read_identification(tmp_path / "modes.json")
    assert plain(document) == plain(identification_document(identification))
    assert document.setups is not None
    assert identification.setups is not None
    assert document.setups.references == ("acc_1",)
    assert document.setups.parts[1].members == tuple(identification.setups.parts[1].members.tolist())
    assert document.as_modes().mode_shapes.shape == (len(identification.modes), 3)


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
