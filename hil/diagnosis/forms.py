"""One curve, one name: a law of friction over speed that only mends the form of another is no second cause.

Contacts follow no law of a library to the last digit. What a Stribeck law leaves of another falling curve looks like a
little drag, and the fit is the better for it; but an engineer who is told of two causes looks for two.
"""

from __future__ import annotations

from collections.abc import Sequence

from hil.diagnosis.proof import Ablation

# Curves of friction over speed alone, beside the Coulomb and viscous friction that every bench has.
CURVES = frozenset({"stribeck_friction", "nonlinear_viscous_friction"})
# Of the energy that the larger law takes away, what a smaller one takes for its form: the best Stribeck law of the
# library, with Coulomb and viscous friction fitted too, leaves up to 2.7 % of the energy of an arctangent, even over
# 150 Stribeck velocities.
OF_ITS_FORM = 0.03


def form_of(ablations: Sequence[Ablation]) -> dict[int, int]:
    """Index of each ablated term that is the form of another, and of that other."""
    curves = [index for index, ablation in enumerate(ablations) if ablation.term.effect in CURVES]
    if len(curves) < 2:
        return {}
    taken = {index: ablations[index].train - 1.0 for index in curves}    # in units of what is left with all of them
    largest = max(curves, key=taken.__getitem__)
    return {index: largest for index in curves if index != largest and taken[index] < OF_ITS_FORM * taken[largest]}
