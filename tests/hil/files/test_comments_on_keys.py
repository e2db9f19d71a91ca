"""Comments on keys of a YAML file that its owner did not write."""

import pytest
import yaml

from hil.files.yaml_edit import YamlChange, with_changes, with_items, without_item

BLOCK = "axis:\n  table_mass_kg: 80.0   # owner\ncontrol:\n  law: unknown\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (BLOCK, BLOCK.replace("# owner\n", "# owner\n  # damping_ratio: not told\n")),
        ("axis: {table_mass_kg: 80.0}\n", "axis: {table_mass_kg: 80.0}   # damping_ratio: not told\n"),
    ],
)
def test_a_comment_on_a_key_that_the_file_lacks_adds_no_value(text: str, expected: str) -> None:
    """A default stays one: with null in its place the file was refused, and written anew without its comments."""
    changed = with_changes(text, [YamlChange(("axis", "damping_ratio"), None, "not told")])
    assert changed == expected
    assert yaml.safe_load(changed) == yaml.safe_load(text)


def test_a_comment_on_a_key_in_a_mapping_that_the_file_lacks_tells_its_whole_path() -> None:
    changed = with_changes(BLOCK, [YamlChange(("axis", "friction", "coulomb_n_m"), None, "not told")])
    assert changed == BLOCK.replace("# owner\n", "# owner\n  # friction.coulomb_n_m: not told\n")
    assert yaml.safe_load(changed) == yaml.safe_load(BLOCK)


def test_items_go_below_a_list_of_which_all_are_comments() -> None:
    text = "name: a\nmechanisms:\n  - effect: backlash\n    parameters: {gap_m: 1.0e-6}\n# end\n"
    text = without_item(text, "mechanisms", 0, "doubtful")
    text = with_items(text, "mechanisms", "- effect: constant_load\n  parameters: {load_torque_n_m: 0.1}\n")
    told = yaml.safe_load(text)
    assert told == {"name": "a", "mechanisms": [{"effect": "constant_load", "parameters": {"load_torque_n_m": 0.1}}]}
    assert "backlash" in text
