"""Tables of an identification."""

import pytest

from sprung.identification import cov_ssi
from sprung.results.tables import modes_table
from sprung.simulation import simulate, usual_excitation
from sprung.vehicles import chain


@pytest.fixture(scope="module")
def identification():
    """Return three modes by SSI."""
    masses = chain()
    return cov_ssi(simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=500.0, seed=1))


def test_the_source_is_shown_where_a_vehicle_on_its_road_gives_modes(identification) -> None:
    assert "source" not in modes_table(identification.modes, identification.sources).columns
    table = modes_table(identification.modes, ("ssi", "road_likelihood", "ssi"))
    column = table.columns.index("source")
    assert [row[column] for row in table.rows] == ["SSI", "vehicle on its road", "SSI"]
    assert {len(row) for row in table.rows} == {len(table.columns)}
