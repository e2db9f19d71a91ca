"""A measured ISO 230-2 table with its published results: 5 targets, 5 cycles, both directions.

Paul Scherrer Institute, ecmccfg, examples/test/fat_sat/report.md (8 December 2023): a linear stage against an encoder.
All in mm, as printed. The report's bidirectional E, R and A are the greatest of one direction, not those of the
standard; they are computed in the test instead.
"""

TARGET_MM = (-10.0, -4.88, 0.24, 5.36, 10.48)
FORWARD_MM = (
    (-10.00008102, -10.00010202, -10.00008702, -10.00009202, -10.00010002),
    (-4.88008702, -4.88009702, -4.88009702, -4.88009502, -4.88008202),
    (0.23992798, 0.23990998, 0.23991198, 0.23991298, 0.23991298),
    (5.35989798, 5.35991398, 5.35991398, 5.35990698, 5.35992198),
    (10.47989998, 10.47988798, 10.47987098, 10.47989098, 10.47990298),
)
BACKWARD_MM = (
    (-10.00009902, -10.00009402, -10.00008202, -10.00009102, -10.00009402),
    (-4.88010302, -4.88010402, -4.88009502, -4.88011102, -4.88009302),
    (0.23991398, 0.23989798, 0.23990898, 0.23992398, 0.23990098),
    (5.35992798, 5.35990798, 5.35990498, 5.35989698, 5.35991898),
    (10.47989598, 10.47987398, 10.47986998, 10.47985898, 10.47989298),
)
MEAN_MM = (
    (-9.242e-05, -9.162e-05, -8.482e-05, -8.902e-05, -0.00010942),
    (-9.202e-05, -0.00010122, -9.082e-05, -8.862e-05, -0.00012162),
)
ESTIMATOR_MM = (
    (8.79e-06, 6.77e-06, 7.26e-06, 9e-06, 1.258e-05),
    (6.28e-06, 7.29e-06, 1.043e-05, 1.218e-05, 1.573e-05),
)
REVERSAL_MM = (-4e-07, 9.6e-06, 6e-06, -4e-07, 1.22e-05)
REPEATABILITY_MM = (3.517e-05, 3.772e-05, 4.17e-05, 4.871e-05, 6.882e-05)
FIGURES_MM = {
    "reversal_m": 1.22e-05,
    "mean_reversal_m": 5.4e-06,
    "repeatability_forward_m": 5.033e-05,
    "repeatability_backward_m": 6.29e-05,
    "systematic_forward_m": 2.46e-05,
    "systematic_backward_m": 3.3e-05,
    "mean_range_m": 2.77e-05,
    "accuracy_forward_m": 6.428e-05,
    "accuracy_backward_m": 8.881e-05,
}
