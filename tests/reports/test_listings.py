"""``rb.list_detectors()`` and its like: what there is, as data frames."""

import roofbench as rb


def test_each_list_has_one_line_for_each_name():
    detectors = rb.list_detectors()
    assert detectors.loc["ndsm", "inputs"] == "points"
    assert {"original", "improved", "mpp"} <= set(detectors.index)
    assert "threshold-free" in rb.list_evaluators().index
    assert rb.list_indices().loc["object.quality", "symbol"].iloc[0] == "Q_l"
    assert {"delft", "ign", "knox"} <= set(rb.list_scenes().index)
    assert "quick" in rb.list_suites().index
    assert all(frame["meaning"].str.len().all() for frame in (detectors, rb.list_suites()))
