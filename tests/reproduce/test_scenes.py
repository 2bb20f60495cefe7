"""[GEO] figs. 7-10: the numbers that the studies must find."""

import numpy as np

from hdvplan.reproduce import published
from hdvplan.reproduce.study import Study
from tests.reproduce.conftest import by_name


def test_the_previous_method_uses_all_of_the_road_and_the_proposed_one_balances(uturn_study: Study) -> None:
    rows = by_name(uturn_study)
    # 0.03 and 0.01 m: how well an earlier check of the same equations agreed with the paper's figure
    assert abs(rows["previous method, max right"].ours - 3.00) < 0.03
    assert abs(rows["previous method, max left"].ours - 1.88) < 0.03
    assert abs(rows["proposed method, max right"].ours - 2.48) < 0.01
    assert abs(rows["proposed method, max left"].ours - 2.48) < 0.01
    assert abs(rows["geometric half width"].ours - 2.486) < 5e-4  # as printed


def test_the_data_hold_what_the_table_says(uturn_study: Study) -> None:
    rows, data = by_name(uturn_study), uturn_study.data
    assert rows["previous method, max left"].ours == data["previous_left"].max()
    assert rows["proposed method, max right"].ours == -data["proposed_right"].min()
    assert data["previous_right"].min() > -3.01  # hard limits, kept to a centimetre


def test_the_roundabout_follows_the_published_curves(roundabout_study: Study) -> None:
    rows, data = by_name(roundabout_study), roundabout_study.data
    # these four bounds are the study's own acceptance criteria
    assert 0.0 < rows["curvature off theirs, largest"].ours <= 0.012
    assert 0.0 < rows["articulation off theirs, largest"].ours <= 0.03
    assert 0.0 < rows["curvature off theirs, constant part"].ours <= 0.001
    assert 0.0 < rows["articulation off theirs, constant part"].ours <= 0.01
    # and once more from the written data: theirs interpolated to 0.25 m, a third of a station off at most
    assert np.max(np.abs(data["kappa"] - data["published_kappa"])) <= 0.012
    assert np.max(np.abs(data["beta"] - data["published_beta"])) <= 0.03


def test_the_roundabout_settles_in_the_geometric_values(roundabout_study: Study) -> None:
    rows = by_name(roundabout_study)
    assert abs(rows["tractor curvature, constant part"].ours - 0.05393) < 1e-4  # 5 digits are known
    assert abs(rows["articulation, constant part"].ours - 0.4604) < 1e-3
    assert abs(rows["expected half width"].ours - 2.273) < 1e-3
    for side in ("left", "right"):
        assert abs(rows[f"max {side}"].ours - 2.28) < 0.03  # between 2.26 and 2.30, as published
    assert abs(rows["max left as an Euler plan predicts it"].ours - 2.298) < 0.002  # known to a millimetre from another check
    assert abs(rows["max right as an Euler plan predicts it"].ours - 2.280) < 0.002


def test_the_published_curves_are_complete_and_lie_where_the_road_does() -> None:
    curves = published.curves()
    assert len(curves) == 9
    for name, points in curves.items():
        assert points.shape[1] == 2
        assert abs(points[0, 0]) < 0.01  # digitised from the first station on
        assert abs(points[-1, 0] - 246.0) < 0.5, name  # to the last
    assert abs(curves["kappa_road"][:, 1].max() - 1.0 / 17.88) < 1e-4
