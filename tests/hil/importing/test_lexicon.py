"""The words of the lexicon are data: a word more is read, a damaged file is refused with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import InputError
from hil.files.yaml_model import load_model
from hil.importing import lexicon as module
from hil.importing.column_names import label
from hil.importing.header_values import header_values
from hil.importing.lexicon import LEXICON, Constant, Lexicon, Quantity
from hil.importing.units import unit_named


def changed(tmp_path: Path, old: str, new: str) -> Path:
    text = LEXICON.read_text(encoding="utf-8")
    assert text.count(old) == 1
    path = tmp_path / "lexicon.yaml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_a_language_more_is_a_line_in_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert label("hastighet").quantity is Quantity.UNKNOWN
    path = changed(tmp_path, "    it: velocita\n", "    it: velocita\n    sv: hastighet\n")
    known = load_model(path, Lexicon)
    for reader in ("hil.importing.column_names", "hil.importing.units"):
        monkeypatch.setattr(f"{reader}.lexicon", lambda: known)
    assert label("hastighet").quantity is Quantity.VELOCITY


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  ns: {all: ns nsec", "  ns: {all: ns nsec ms", r"units: 'ms' stands for two units"),
        ("  mrad: {all: mrad}", "  milliradian: {all: mrad}", r"units\.milliradian: is no unit of a map"),
        ("  fr: reel mesure", "  French: reel mesure", "allowed lines LANGUAGE: WORDS"),
        ("fr: fe}", "fr: [fe]}", "allowed lines LANGUAGE: WORDS"),
        ("bezugs)(dreh)?moment", "bezugs)(dreh?moment", "allowed regular expressions"),
        ("hz: 1.0, khz: 1e3", "hz: 1.0, khz: fast", r"khz: given 'fast'"),
        ("  acceleration:\n", "  accelerations:\n", "quantities"),
        ("\ncommand:\n", "\ncommands:\n", "did you mean command"),
        ("  rated_force:\n", "  rated force:\n   -", "broken YAML|given"),
    ],
)
def test_a_damaged_lexicon_is_refused_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=rf"lexicon\.yaml:\d+: .*({message})"):
        load_model(changed(tmp_path, old, new), Lexicon)


def test_each_word_is_read_as_what_it_stands_for() -> None:
    known = module.lexicon()
    for quantity, words in known.quantities.items():
        for word in words:
            found = label(f"{word}_").quantity
            assert found is quantity or list(known.quantities).index(found) < list(known.quantities).index(quantity)
    for unit, spellings in known.units.items():
        assert {unit_named(spelling.upper()) for spelling in spellings} == {unit}


@pytest.mark.parametrize(
    ("line", "constant", "value"),
    [
        ("Abtastrate: 2 kHz", Constant.RATE, 2000.0),
        ("periodo di campionamento = 0.5 ms", Constant.RATE, 2000.0),
        ("constante de par; 0.75 Nm/A", Constant.TORQUE, 0.75),
        ("Pas de la vis (mm): 5", Constant.LEAD, 0.005),
    ],
)
def test_constants_are_read_in_each_language(line: str, constant: Constant, value: float) -> None:
    assert header_values([line], {})[constant].value == pytest.approx(value)
