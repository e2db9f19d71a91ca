"""Constants that stand above the numbers of a file, or beside them as scalars, are used in the drafted map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_axis import axis, csv_text, renamed

from hil.importing.draft_map import draft_map
from hil.importing.header_values import header_values
from hil.importing.lexicon import Constant

AXIS = axis()


@pytest.mark.parametrize(
    ("line", "constant", "value"),
    [
        ("Abtastrate;800 Hz", Constant.RATE, 800.0),
        ("# recorded with a sampling rate of 1 kHz, 3 axes", Constant.RATE, 1000.0),
        ("Sampling interval: 0.5 ms", Constant.RATE, 2000.0),
        ("Group\tLeg3\twf_increment\t0.002", Constant.RATE, 500.0),
        ("Fréquence d'échantillonnage : 2 kHz", Constant.RATE, 2000.0),
        ('"Torque constant: 0.8 Nm/A"', Constant.TORQUE, 0.8),
        ("Constante de par: 0,42 N·m/A", Constant.TORQUE, 0.42),
        ("torque constant 50 mN m/A at 20 C", Constant.TORQUE, 0.05),
        ("Force constant = 67 N/A", Constant.FORCE, 67.0),
        ("gtau = 35.15 N/V", Constant.FORCE_GAIN, 35.15),
        ("torque monitor 0.4 N m/V", Constant.TORQUE_GAIN, 0.4),
        ("Drehmomentausgang 300 mNm/V", Constant.TORQUE_GAIN, 0.3),
        ("Lead [mm];5", Constant.LEAD, 0.005),
        ("Encoder counts per rev,10000", Constant.COUNTS, 10000.0),
        ("Nennmoment (Nm): 1,27", Constant.RATED_TORQUE, 1.27),
        ("Bezugsmoment (100 %) [Nm];2,40", Constant.RATED_TORQUE, 2.4),
        ("// sampling trace; node=3; f_sample=2000Hz; n=128000", Constant.RATE, 2000.0),
        ("cycle_ms: 4", Constant.RATE, 250.0),
        ("leg 3   500 Hz", Constant.RATE, 500.0),
        ("`leg3.dat`, tab separated, two header lines, 500 Hz, 48 s:", Constant.RATE, 500.0),
        ("Horizontal linear motor, 300 mm travel. Logged at 4 kHz.", Constant.RATE, 4000.0),
        ("`rundtisch.parquet`, 2000 Hz:", Constant.RATE, 2000.0),
        ("The scope exports two files with the same samples, 200 Hz, 120 s:", Constant.RATE, 200.0),
        ("Polled by PC at nominal 500 Hz, 48 s", Constant.RATE, 500.0),
        ("trace.csv: recorded by the drive at 2 kHz; PWM 8 kHz", Constant.RATE, 2000.0),
        ("- linear encoder, 1 count = 0.05 um", Constant.COUNTS_PER_M, 2e7),
        ("# 1 count = 0,1 um", Constant.COUNTS_PER_M, 1e7),
        ("Rated torque,1.27,Nm,,", Constant.RATED_TORQUE, 1.27),
        ("Motor\tX-075\tRated torque 2.39 [N·m]\tRated speed 3000 [min-1]", Constant.RATED_TORQUE, 2.39),
        ("torque in % of Mn = 4,10 Nm", Constant.RATED_TORQUE, 4.1),
        ("Motor rated torque (0x6076)\t85000 uNm", Constant.RATED_TORQUE, 0.085),
        ('"モータ","定格トルク 1.3[N・m] 定格回転速度 3000[r/min]"', Constant.RATED_TORQUE, 1.3),
        ("MOTOR.KT = 0.530 [Nm/Arms]", Constant.TORQUE, 0.53),
        ("motor 8 pole, 92 mNm/A", Constant.TORQUE, 0.092),
        ("CA[18] = 4000 [counts/rev]", Constant.COUNTS, 4000.0),
        ("Encoder 23 bit/rev", Constant.COUNTS, 2.0**23),
        ("linear encoder, 1000 cnt/mm", Constant.COUNTS_PER_M, 1e6),
        ("1 Umdr = 5 mm", Constant.LEAD, 0.005),
        ("Sampling: 8 kHz (125 us)", Constant.RATE, 8000.0),
        ("counts/rev: 10000", Constant.COUNTS, 10000.0),
        ("enc counts per motor rev = 4096", Constant.COUNTS, 4096.0),
        ("scaling: 100 % = 3,2 Nm", Constant.RATED_TORQUE, 3.2),
        ("100% corresponds to 12 N", Constant.RATED_FORCE, 12.0),
        ("kt = 0.22", Constant.TORQUE, 0.22),
        ("Motor rated torque;3,5", Constant.RATED_TORQUE, 3.5),
        ("Z axis, ball screw with 10 mm pitch directly coupled to the motor", Constant.LEAD, 0.01),
        ("roller screw 4 mm lead, motor coaxial with the screw.", Constant.LEAD, 0.004),
        ("Spindel mit 5 mm Steigung", Constant.LEAD, 0.005),
        ("* ACT[mm] - motor encoder converted by the 10 mm screw lead, 1 um display", Constant.LEAD, 0.01),
        ("pulley 160 mm per turn -> 32 mm feed per motor revolution", Constant.LEAD, 0.032),
        (
            "belt 2:1 - ball screw 20 mm lead -> 10 mm ram travel per motor turn. Stroke 0...120 mm",
            Constant.LEAD,
            0.01,
        ),
        ("Vorschub 12 mm je Motorumdrehung", Constant.LEAD, 0.012),
        ("One sample every 1 ms. Current is the measured q-current.", Constant.RATE, 1000.0),
        ("rolls 120 mm diameter, so 75.398 mm of strip per motor turn.", Constant.LEAD, 0.075398),
        ("gearbox and belt; one motor turn is 31.416 mm of belt.", Constant.LEAD, 0.031416),
        ("Lead ........ 5 mm", Constant.LEAD, 0.005),
        ("torque in percent of the rated torque; rated torque is 40 Nm", Constant.RATED_TORQUE, 40.0),
        ("codeur  motor encoder in increments, 8192 per motor turn", Constant.COUNTS, 8192.0),
        ("Encoder 20000 steps per turn, absolute", Constant.COUNTS, 20000.0),
        ("Two encoders: motor (16384 per motor turn) and a scale", Constant.COUNTS, 16384.0),
        ("separated by blanks, 250 samples per second", Constant.RATE, 250.0),
        ("Tacho encoder: 60 pulses per rev; motor encoder: 8192 per motor turn", Constant.COUNTS, 8192.0),
        ("Stepper, 200 steps per turn, servo encoder 8192 counts per rev", Constant.COUNTS, 8192.0),
        ("n = sample number at 2000 samples/s, angle in degrees", Constant.RATE, 2000.0),
        ("Logger takes 50 rows/s, 60 s.", Constant.RATE, 50.0),
        (
            "actual torque as the drive shows it, 100 % = 3.2 Nm rated torque. Motor on the screw",
            Constant.RATED_TORQUE,
            3.2,
        ),
        ("speed in rpm, torque in percent of the rated 12 Nm.", Constant.RATED_TORQUE, 12.0),
        ("encoder in increments, 16384 per motor turn (zero). CH2 behind the gear.", Constant.COUNTS, 16384.0),
        ("decimal comma, 5 ms per line", Constant.RATE, 200.0),
        ("One sample every 250 microseconds", Constant.RATE, 4000.0),
        ("Torque const. 0.5 Nm/A", Constant.TORQUE, 0.5),
        ("30 um cyclic error per motor rev; lead 5 mm", Constant.LEAD, 0.005),
        ("TS = 90 [usec] ; RG = 8 ; interval = TS * RG", Constant.RATE, 1.0 / 720e-6),
    ],
)
def test_a_line_gives_a_constant_in_si(line: str, constant: Constant, value: float) -> None:
    found = header_values([line], {})
    assert list(found) == [constant]
    assert found[constant].value == pytest.approx(value)


@pytest.mark.parametrize(
    "line",
    [
        "Fecha;12/03/2026",
        "6 pole pairs, 6 per motor turn",
        "Torque ripple of the motor: 24 per motor turn",
        "i = 90, motor 90 per turn of the table",
        "Encoder 5000 steps per turn of the gearbox output",
        "Stepping motor 200 steps per turn",
        "Encoder 2500 steps per turn, before quadrature",
        "Temperature logger: 10 samples per second",
        "ADC at 48000 samples/s, decimated",
        "current in percent of the rated 5 A",
        "speed in percent of rated 3000",
        "peak is 3 times of rated, 12 Nm",
        "grating 500 lines per s",
        "1,000 samples per second in this file",
        "cable lead is 2 m long",
        "dwell interval is 0.2 s",
        "drill time 2 ms per point",
        "a ring encoder on the table (3.6 million steps per turn)",
        "Motor encoder on the gear, 90 per table turn",
        "pole pitch 24 mm",
        "magnet track with 32 mm pitch",
        "a screw of 5 mm lead error",
        "pinion 235.6 mm per pinion turn",
        "The stage has 300 mm lead screw stroke",
        "0.02 mm lead accuracy",
        "20 mm lead-in chamfer",
        "gearbox with 30 Nm rated torque",
        "PLC with 2 ms cycle time",
        "Backlash 0.1 mm per motor rev",
        "30 um of runout per motor turn",
        "1 m long belt per motor turn",
        "voltage constant 0.8 Nm/A",
        "The brake has 2 N m/V, not recorded.",
        "Controller gain Kp = 120 N m/V",
        "force sensor 20 N/V",
        "load cell 200 N/V",
        "rated torque 0x6076",
        "Sampling interval [ms];1;2;2",
        "Torque constant: 0.8 mm",
        "Torque constant: 0 Nm/A",
        "t n 5",
        "km 5",
        "Lead: 5",
        "100 % = 12",
        "Torque constant: see manual",
        "cycle: 12",
        "cycle: 0.05",
        "Cycle [s]: 12",
        "max reference torque 5 Nm",
        "freq samples: 100 Hz",
        "sum of four sines (0.23, 0.61, 1.3, 2.9 Hz, up to 12 mm)",
        "- gains: Kv 40 1/s, velocity loop 45 Hz, Tn 12 ms",
        "current loop   8 kHz",
        "Speed loop, 8 kHz, 3 s",
        "Table vibration, 40 Hz, 10 s",
        "Friction 0.25 N, 50 Hz,",
        "record with low pass at 100 Hz",
        "run.csv: multisine, 0.4 to 31 Hz, nine lines",
        "1 count = 2 mNm",
        "following error: 1 count = 2 um",
        "Torque sampled in the drive at 16 kHz, decimated to 1 kHz",
        "Recorded with anti-aliasing at 400 Hz",
        "Mains: 400 V   50 Hz",
        "Kerbfilter   210 Hz",
        "Bewegung.csv: Sinus, 20 Hz",
        "Logged at 2.000 Hz",
        "t;x;y",
        "1;2;3",
        "",
    ],
)
def test_another_line_gives_none(line: str) -> None:
    assert header_values([line], {}) == {}


def test_a_scalar_gives_a_constant_by_its_name_and_two_values_none() -> None:
    found = header_values([], {"sample_rate_hz": 200.0, "torqueConstant_Nm_A": 0.3, "mass": 2.0})
    assert {one: told.value for one, told in found.items()} == {Constant.RATE: 200.0, Constant.TORQUE: 0.3}
    named = header_values([], {"torque_constant_Nm_per_A": 2.9, "encoder_counts_per_rev": 4194304.0})
    assert {one: told.value for one, told in named.items()} == {Constant.TORQUE: 2.9, Constant.COUNTS: 4194304.0}
    assert header_values(["Torque constant: 0.8 Nm/A", "Motor constant: 0.7 Nm/A"], {}) == {}


def test_a_current_is_converted_with_the_constant_of_the_header(tmp_path: Path) -> None:
    amps = renamed(AXIS | {"torque": AXIS["torque"] / 0.8}, t="time_s", angle="motor_angle_rad", torque="current_A")
    path = tmp_path / "log.csv"
    path.write_text('"Drive export v3.2"\n"Torque constant: 0.8 Nm/A"\n' + csv_text(amps))
    draft = draft_map(path)
    entry = next(one.entry for one in draft.channels if one.channel == "torque_n_m")
    assert entry["unit"] == "A"
    assert entry["torque_constant_n_m_a"] == 0.8
    assert any("Torque constant: 0.8 Nm/A" in note for note in draft.unsure)


def test_rows_of_an_axis_at_rest_are_kept_where_no_column_is_a_stamp(tmp_path: Path) -> None:
    still = renamed(AXIS, angle="motor_angle_rad", torque="torque_Nm")
    still = {name: np.concatenate([values, np.full(20, values[-1])]) for name, values in still.items()}
    path = tmp_path / "log.csv"
    path.write_text("Abtastrate: 1000 Hz\n" + csv_text(still))
    draft = draft_map(path)
    rows = len(next(iter(still.values())))
    assert draft.clock.rate_hz == 1000.0
    assert draft.clock.time_s.size == rows
    assert not [note for note in draft.unsure if "left out" in note]


def test_a_rate_among_other_words_gives_way_to_one_that_is_named() -> None:
    found = header_values(["Sampling rate 1 kHz.", "other.csv: 10 samples per second"], {})
    assert found[Constant.RATE].value == 1000.0
