"""One curve, one name: a drag that only mends the form of a Stribeck curve is no second cause.

Contacts follow no law of a library to the last digit. What a Stribeck law leaves of another falling curve looks like a
little drag, and the fit is the better for it; but an engineer who is told of two causes looks for two. The other way
round does not hold: a Stribeck curve beside much drag takes little because it acts at low speed alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.search.forward_selection import Explanation
from hil.diagnosis.verdict.cross_validation import Ablation
from hil.diagnosis.verdict.findings import rivals_of
from hil.twin.library import LIBRARY

_FALLING, _DRAG = next(
    (variant.form_of, (mechanism.id, index))
    for mechanism in LIBRARY
    for index, variant in enumerate(mechanism.variants)
    if variant.form_of
)
# Of the energy that the Stribeck law takes away, what a drag takes for its form. Fitted to an arctangent, with Coulomb
# and viscous friction free, over 5 to 150 Stribeck velocities, drag takes up to 1.3 % beside the best of the laws; five
# such contacts among development cases asked for up to 1.0 %. The laws themselves may differ by `explain.FORM`.
OF_ITS_FORM = 0.02


def form_of(explanation: Explanation, ablations: Sequence[Ablation]) -> dict[int, int]:
    """Index of the ablated term that is the form of another, and of that other; none where it ties with something else,
    which may be there instead."""
    law = next((index for index, ablation in enumerate(ablations) if ablation.term.effect == _FALLING), None)
    drag = next(
        (index for index, ablation in enumerate(ablations) if (ablation.term.effect, ablation.term.variant) == _DRAG),
        None,
    )
    if law is None or drag is None or any(rival.tied for rival in rivals_of(explanation, ablations[drag].term)):
        return {}
    takes, whole = ablations[drag].train - 1.0, ablations[law].train - 1.0  # in units of what is left with both
    return {drag: law} if takes < OF_ITS_FORM * whole else {}
