"""How far the candidates of a sealed proof are from each constant of evidence.

    python tests/net/margins.py PROOF          a folder of `hil prove`, answered

The ledger of every fitted candidate (`considered` in diagnosis.json) is held against the sealed truth: a candidate is
right if it is a concealed effect, or another name of its law. For each rule with one bound the table has the number of
right and wrong candidates that it accepts and refutes, and how many of them would change sides at half and at twice the
bound. A constant is well placed if right ones are accepted, wrong ones refuted, and few change.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from hil.diagnosis.criteria import CRITERIA
from hil.validation.proof.draw.expected import same_law


class Bound(NamedTuple):
    """A rule, the figure that it compares, and its bound: the figure is accepted at `bound` and above, or below."""

    rule: str
    figure: str
    bound: float
    above: bool = True

    def accepts(self, value: float, factor: float = 1.0) -> bool:
        """Answer of the rule at a multiple of the bound."""
        return value >= factor * self.bound if self.above else value < factor * self.bound


BOUNDS = (
    Bound("evidence", "evidence", CRITERIA.evidence),
    Bound("material energy", "removed", CRITERIA.material),
    Bound("share of the mismatch", "explained", CRITERIA.worth),
    Bound("constant force", "left", CRITERIA.form, above=False),
    Bound("beside the named one", "against", CRITERIA.tied, above=False),
    Bound("beside the named one", "more", CRITERIA.alike, above=False),
    Bound("held-out recordings", "evidence", -CRITERIA.tied),
    Bound("explains the mismatch", "left", CRITERIA.little, above=False),
)


def candidates(proof: Path) -> Iterator[tuple[bool, dict[str, Any]]]:
    """Each candidate of each answered case, and whether it is right."""
    truths = json.loads((proof / "sealed" / "truths.json").read_text())
    for name, entry in truths.items():
        answer = proof / "answers" / name / "diagnosis.json"
        if answer.exists():
            right = {one for effect in entry["truth"]["effects"] for one in same_law(effect["effect"])}
            for candidate in json.loads(answer.read_text())["considered"]:
                yield candidate["effect"] in right, candidate


def main(proof: Path) -> None:
    """Print the table."""
    every = list(candidates(proof))
    named = [right for right, one in every if one["named"]]
    print(
        f"{len(every)} candidates, {sum(right for right, _ in every)} of a concealed effect; named: {len(named)}, ",
        end="",
    )
    print(f"{sum(named)} of them right\n")
    print(f"{'rule':24} {'figure':10} {'bound':>8}  {'right: yes':>10} {'no':>4}  {'wrong: yes':>10} {'no':>5}", end="")
    print("   right, wrong that change at half and at twice the bound")
    for bound in BOUNDS:
        seen = [
            (right, float(answer["figures"][bound.figure]))
            for right, one in every
            for answer in one["rules"]
            if answer["rule"] == bound.rule and answer["figures"].get(bound.figure) is not None
        ]
        counts = {side: [bound.accepts(value) for right, value in seen if right is side] for side in (True, False)}
        changes = [
            sum(bound.accepts(value) != bound.accepts(value, factor) for right, value in seen if right is side)
            for factor in (0.5, 2.0)
            for side in (True, False)
        ]
        yes, no = (sum(counts[side]) for side in (True, False)), (len(c) - sum(c) for c in counts.values())
        (right_yes, wrong_yes), (right_no, wrong_no) = yes, no
        print(f"{bound.rule:24} {bound.figure:10} {bound.bound:8g}  {right_yes:10} {right_no:4}  ", end="")
        print(f"{wrong_yes:10} {wrong_no:5}   {changes[0]}, {changes[1]}; {changes[2]}, {changes[3]}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
