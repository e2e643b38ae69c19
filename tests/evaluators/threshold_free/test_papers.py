"""What is known of the papers' printed tables."""

import pytest

from roofbench.evaluators.overlay.areas import AreaTally
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.evaluators.threshold_free.tallies import Counts, ThresholdFreeTallies

#: Yu et al. 2013, table 1: counts that explain it, then the seven printed percentages.
YU_2013 = {
    "I(a)": (
        {"D": 130, "FP": 2, "FN": 4, "MD": 4, "O_d": 4, "C_ld": 3, "C_lr": 9},
        ("96.97", "98.46", "95.52", "3.08", "3.08", "2.31", "6.92"),
    ),
    "I(b)": (
        {"D": 153, "FP": 3, "FN": 5, "MD": 8, "O_d": 18, "C_ld": 9, "C_lr": 8},
        ("96.77", "98.04", "94.94", "5.23", "11.76", "5.88", "5.23"),
    ),
    "II(a)": (
        {"D": 263, "FP": 8, "FN": 10, "MD": 6, "O_d": 9, "C_ld": 5, "C_lr": 15},
        ("96.23", "96.96", "93.41", "2.28", "3.42", "1.90", "5.70"),
    ),
    "II(b)": (
        {"D": 290, "FP": 15, "FN": 16, "MD": 10, "O_d": 19, "C_ld": 9, "C_lr": 18},
        ("94.50", "94.83", "89.87", "3.45", "6.55", "3.10", "6.21"),
    ),
}

YU_COLUMNS = (
    "multiple_as_correct.completeness",
    "multiple_as_correct.correctness",
    "multiple_as_correct.quality",
    "object.multiple_detection_rate",
    "object.detection_overlap_rate",
    "object.detection_cross_lap_rate",
    "multiple_as_correct.reference_cross_lap_rate",
)


@pytest.mark.parametrize("data", YU_2013)
def test_the_table_of_yu_2013_is_reproduced_digit_for_digit(data):
    counts, printed = YU_2013[data]
    numbers = Counts(
        detected=counts["D"],
        true_positives=counts["D"] - counts["FP"] - counts["MD"],
        false_positives=counts["FP"],
        false_negatives=counts["FN"],
        multiple_detections=counts["MD"],
        overlapping_detections=counts["O_d"],
        cross_lapping_detections=counts["C_ld"],
        cross_lapped_references=counts["C_lr"],
    )
    values = ThresholdFree().summarise(ThresholdFreeTallies(counts=numbers)).values
    assert tuple(f"{100 * values[key]:.2f}" for key in YU_COLUMNS) == printed


#: Awrangjeb et al. 2010, table 2, in percent: C_mp, C_rp, Q_lp, A_oe, A_ce, B_f, M_f.
PIXELS_2010 = {
    "scene 1": (77.32, 89.29, 70.07, 22.68, 10.35, 12.00, 29.33),
    "scene 2": (77.97, 87.05, 67.40, 22.03, 12.67, 14.87, 28.26),
    "scene 3": (79.51, 90.35, 72.11, 20.49, 7.54, 10.68, 25.77),
}


@pytest.mark.parametrize("scene", PIXELS_2010)
def test_the_pixel_table_of_2010_obeys_our_formulas_but_for_the_commission_error(scene):
    completeness, correctness, _, omission, commission, branching, miss = PIXELS_2010[scene]
    # Areas with the printed completeness and correctness: T = 1, M = 1/C_mp - 1, F = 1/C_rp - 1.
    areas = AreaTally(true_positive=1.0, false_negative=100 / completeness - 1, false_positive=100 / correctness - 1)
    pixel = ThresholdFree().summarise(ThresholdFreeTallies(areas=areas)).pixel
    assert 100 * pixel.area_omission_error == pytest.approx(omission, abs=0.011)
    assert 100 * pixel.branching_factor == pytest.approx(branching, abs=0.02)
    assert 100 * pixel.miss_factor == pytest.approx(miss, abs=0.02)
    assert 100 * pixel.area_commission_error > commission
