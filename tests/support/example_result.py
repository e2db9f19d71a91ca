"""A small valid result of a diagnosis."""

from typing import Any

FIGURES = {"before_rms": 0.08, "after_rms": 0.0101, "noise_floor_rms": 0.0099, "owner_rms": 0.2}
EXAMPLE: dict[str, Any] = {
    "verdict": "missing_physics",
    "statement": "There are 24.7 µm of lost motion between screw and table.",
    "location": {
        "block": "transmission",
        "element": "ball nut",
        "channels": ("table_position_m",),
        "phases": ({"kind": "reversal", "share": 0.9},),
        "windows_s": ((0.1, 0.2),),
    },
    "missing": (
        {
            "effect": "backlash",
            "confidence": 0.9,
            "equivalents": ("preload_loss",),
            "rivals": ({"effect": "preload_loss", "evidence": "close"},),
            "parameters": {"gap_m": {"value": 2.4e-5, "std": 1e-8, "unit": "m"}},
            "sentence": "lost motion",
        },
    ),
    "parameter_corrections": {"motor_mass_kg": {"nominal": 335.0, "value": 330.0, "std": 0.1, "unit": "kg"}},
    "fit": {
        "torque_n_m": {
            "unit": "N m",
            "mode": "closed_loop",
            "floor_from": "white_noise",
            "train": FIGURES,
            "validate": FIGURES,
        }
    },
    "not_testable": ("thermal_growth",),
    "unexplained": {"share": 0.01, "description": "noise"},
    "runtime_s": 12.0,
}
