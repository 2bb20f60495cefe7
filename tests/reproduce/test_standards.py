"""The studies about standards: what they print as published, and that every difference is accounted for."""

import pytest

from hdvplan.reproduce import published
from hdvplan.reproduce.standards import standards
from hdvplan.reproduce.study import Study
from tests.reproduce.conftest import silent


@pytest.fixture(scope="module")
def study() -> Study:
    return standards(silent)


@pytest.mark.slow
def test_every_row_that_differs_has_a_remark_and_every_vehicle_a_panel(study: Study) -> None:
    assert [row.quantity for row in study.rows if row.differs and not row.remark] == []
    assert len(study.figure().axes) == 4


@pytest.mark.slow
def test_the_two_figures_that_do_not_match_stay_in_the_table_with_what_explains_them(study: Study) -> None:
    remarks = {row.quantity: row.remark for row in study.rows if row.remark.startswith("not reproduced")}
    assert set(remarks) == {"WB-62: outside radius, front overhang", "WB-67: outside radius, front overhang", "WB-67: articulation"}


@pytest.mark.slow
def test_what_was_not_read_in_a_source_is_not_printed_as_published(study: Study) -> None:
    printed = {row.quantity.split(":")[0] for row in study.rows if row.published is not None and "inside radius" in row.quantity}
    assert printed == set(published.TURN_INSIDE) == {"P", "CITY-BUS", "WB-40", "WB-62", "WB-67"}
    assert not any(row.published for row in study.rows if row.quantity.startswith("EU"))
