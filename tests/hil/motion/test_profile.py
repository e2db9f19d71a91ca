"""Profile files: the shipped ones, what they mean, and what is refused with file, line and field."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from hil.errors import InputError
from hil.manual.schemas import schema_text
from hil.motion.profile import Profile, load_profile

ROOT = Path(__file__).parents[3]
SHIPPED = sorted((ROOT / "profiles").iterdir())
HEAD = """schema_version: 1
limits: {velocity_m_s: 0.5, acceleration_m_s2: 2.0, jerk_m_s3: 100.0}
position_min_m: -0.01
position_max_m: 0.3
segments:
"""


def load(tmp_path: Path, segments: str, head: str = HEAD) -> Profile:
    path = tmp_path / "profile.yaml"
    path.write_text(head + segments, encoding="utf-8")
    return load_profile(path)


def test_profiles_are_all_there() -> None:
    assert {path.name for path in SHIPPED} == {
        f"{name}.yaml"
        for name in (
            "reference",
            "reference_100mm_7",
            "reference_100mm_22",
            "reference_100mm_30",
            "frequency_response",
            "friction_sweep",
            "reversal",
            "creep",
            "chirp",
            "multisine",
            "jog",
            "identification",
            "positioning_iso_230_2",
            "circle_x",
            "circle_y",
        )
    }


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_profile_loads_and_names_its_schema(path: Path) -> None:
    profile = load_profile(path)
    assert profile.description
    first, _, rest = path.read_text(encoding="utf-8").partition("\n")
    schema = path.parent / first.removeprefix("# yaml-language-server: $schema=")
    jsonschema.validate(yaml.safe_load(rest), json.loads(schema.read_text(encoding="utf-8")))


def test_the_published_schema_is_current() -> None:
    assert (ROOT / "hil/motion/profile.schema.json").read_text(encoding="utf-8") == schema_text("profile"), (
        "run: hil validate --schema profile > hil/motion/profile.schema.json"
    )


def test_repeats_are_unrolled_with_a_lap_number_for_each_place(tmp_path: Path) -> None:
    profile = load(
        tmp_path,
        """
- {kind: dwell, duration_s: 0.1}
- kind: repeat
  times: 2
  segments:
  - {kind: sine_squared, stroke_m: 0.1, feed_m_s: 0.1}
  - kind: repeat
    times: 2
    segments: [{kind: sine_squared, stroke_m: -0.05, feed_m_s: 0.1}]
""",
    )
    assert [(run.field[1:], run.lap, round(run.start_m, 9)) for run in profile.runs] == [
        ((0,), 0, 0.0),
        ((1, "segments", 0), 0, 0.0),
        ((1, "segments", 1, "segments", 0), 0, 0.1),
        ((1, "segments", 1, "segments", 0), 1, 0.05),
        ((1, "segments", 0), 1, 0.0),
        ((1, "segments", 1, "segments", 0), 2, 0.1),
        ((1, "segments", 1, "segments", 0), 3, 0.05),
    ]


@pytest.mark.parametrize(
    ("segments", "expected"),
    [
        (
            "- {kind: sine_squared, to_m: 0.1}\n",
            ":6: segments[0].feed_m_s: given nothing, allowed a value (feed [m/s])",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_s: -1\n",
            ":8: segments[0].feed_m_s: given -1, allowed greater than 0 (feed [m/s])",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_s: .nan\n",
            ":8: segments[0].feed_m_s: given nan, allowed a finite",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_s: 7 m/min\n",
            ":8: segments[0].feed_m_s: given '7 m/min', allowed a valid number (feed [m/s])",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_min: 7\n  feed_m_s: 0.1\n",
            ":8: segments[0].feed_m_min: given an unknown key, allowed one of acceleration_m_s2",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_s: 0.6\n",
            ":8: segments[0].feed_m_s: given 0.6, allowed up to 0.5 (limits.velocity_m_s); lower it or raise the limit",
        ),
        (
            "- kind: sine_squared\n  to_m: 0.1\n  feed_m_s: 0.1\n  jerk_m_s3: 200\n",
            ":9: segments[0].jerk_m_s3: given 200, allowed up to 100 (limits.jerk_m_s3)",
        ),
        ("- {kind: sine_squared, feed_m_s: 0.1}\n", ":6: segments[0].stroke_m: given neither of to_m and stroke_m"),
        (
            "- kind: approach\n  feed_m_s: 0.1\n  to_m: 1\n  stroke_m: 1\n",
            ":9: segments[0].stroke_m: given both to_m and",
        ),
        (
            "- {kind: sine_squared, stroke_m: 0, feed_m_s: 0.1}\n",
            ":6: segments[0].stroke_m: given 0, allowed any other",
        ),
        (
            "- {kind: dwell, duration_s: 0.1}\n- {kind: sine_squared, to_m: 0.31, feed_m_s: 0.1}\n",
            ":7: segments[1]: given positions from 0 to 0.31 m, allowed -0.01 to 0.3 m",
        ),
        ("- {kind: jog, velocity_m_s: 0.4, duration_s: 5}\n", ":6: segments[0]: given positions from 0 to"),
        (
            "- kind: jog\n  velocity_m_s: -0.4\n  duration_s: 0.1\n",
            ":8: segments[0].duration_s: given 0.1 s, allowed at least 0.22 s to reach -0.4 m/s",
        ),
        (
            "- kind: reversal\n  stroke_m: 0.001\n  feed_m_s: 0.4\n",
            ":8: segments[0].feed_m_s: given 0.4 m/s (24 m/min), allowed a feed that the limits let turn within 1 mm",
        ),
        (
            "- kind: repeat\n  times: 2\n  segments:\n  - {kind: sine_squared, stroke_m: 0.2, feed_m_s: 0.2}\n",
            ":9: segments[0].segments[0]: given positions from 0.2 to 0.4 m, allowed",
        ),
        (
            "- kind: feed_sweep\n  constant_feed_s: 1\n  stroke_max_m: 0.05\n  feeds_m_s: [0.1, 0.4]\n",
            ":9: segments[0].feeds_m_s[1]: given 0.4 m/s, which the limits do not reach within 50 mm",
        ),
        (
            "- {kind: chirp, start_hz: 1, end_hz: 2, duration_s: 9, amplitude_m: 1, base_feed_m_s: 0.5}\n",
            ":6: segments[0].base_feed_m_s: given 0.5, allowed less than 0.5 m/s",
        ),
        (
            "- {kind: multisine, start_hz: 1.1, end_hz: 1.9, lap_s: 1, amplitude_m: 0.001}\n",
            ":6: segments[0].lap_s: given 0 lines from 1.1 to 1.9 Hz over 3 s, allowed at least one",
        ),
        (
            "- {kind: multisine, start_hz: 1, end_hz: 9, lap_s: 1, amplitude_m: 0.001, spectrum: pink}\n",
            ":6: segments[0].spectrum: given 'pink', allowed 'constant_displacement', ",
        ),
        (
            "- {kind: repeat, times: 9999, segments: [{kind: repeat, times: 9999, segments: "
            "[{kind: dwell, duration_s: 1}]}]}\n",
            ":6: segments[0].segments[0].segments[0]: given a profile that is longer",
        ),
        (
            "- {kind: dwel, duration_s: 1}\n",
            ":6: segments[0].kind: given 'dwel', allowed one of approach, chirp, dwell",
        ),
        ("- {kind: sine_squared, to_m: 0.1, feed_m_s: 1e-323}\n", ":6: segments[0]: given values that cannot be"),
        ("  []\n", ":5: segments: given a list, allowed have at least 1 item"),
    ],
)
def test_what_cannot_be_run_is_refused_with_line_and_field(tmp_path: Path, segments: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, segments)
    assert f"{tmp_path / 'profile.yaml'}{expected}" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("schema_version: 1", "schema_version: 2", ":1: schema_version: given 2, allowed 1"),
        ("velocity_m_s: 0.5", "velocity_m_s: 0", ":2: limits.velocity_m_s: given 0, allowed greater than 0"),
        ("jerk_m_s3: 100.0", "jerk_m_s3: .inf", ":2: limits.jerk_m_s3: given inf, allowed a finite number"),
        ("position_min_m: -0.01", "position_min_m: 0.01", ":1: start_m: given positions from 0 to 0 m, allowed 0.01"),
    ],
)
def test_wrong_limits_are_refused(tmp_path: Path, old: str, new: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        load(tmp_path, "- {kind: dwell, duration_s: 1}\n", HEAD.replace(old, new))
    assert f"{tmp_path / 'profile.yaml'}{expected}" in str(caught.value)


def test_a_shipped_profile_has_a_short_name_that_no_file_without_yaml_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert load_profile("jog") == load_profile(ROOT / "profiles" / "jog.yaml")
    with pytest.raises(
        InputError, match=r"nowhere: no such profile; give a \.yaml file or one of chirp, .*creep, .*jog"
    ):
        load_profile("nowhere")
    monkeypatch.chdir(tmp_path)
    for name in ("jog", "mine", "jog.yaml"):
        (tmp_path / name).write_text((ROOT / "profiles" / "creep.yaml").read_text())
    assert load_profile("jog") == load_profile(ROOT / "profiles" / "jog.yaml")
    assert load_profile("mine") == load_profile("jog.yaml") == load_profile("creep")
