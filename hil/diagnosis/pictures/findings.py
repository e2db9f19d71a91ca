"""Figure of a finding: the law of its mechanism through the measured points, as its textbook draws it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.diagnosis.pictures.delay import cross_correlation
from hil.diagnosis.pictures.friction import friction_over_speed
from hil.diagnosis.pictures.hysteresis import friction_loop, lost_motion
from hil.diagnosis.pictures.law_figures import law_picture
from hil.diagnosis.pictures.laws import LAWS
from hil.diagnosis.pictures.over_time import residual_over_time
from hil.diagnosis.pictures.response import frequency_response
from hil.diagnosis.pictures.view import Captioned, Drawer, view_of
from hil.diagnosis.pictures.windows import force_over_time
from hil.diagnosis.turning import labelled
from hil.identification.terms import Term
from hil.twin.library import BY_ID
from hil.twin.picture import Picture

if TYPE_CHECKING:
    from hil.diagnosis.diagnosis import Diagnosis

PICTURES: dict[Picture, Drawer] = {
    Picture.TIME: residual_over_time,
    Picture.FORCE: force_over_time,
    Picture.FRICTION: friction_over_speed,
    Picture.FRICTION_LOOP: friction_loop,
    Picture.LOST_MOTION: lost_motion,
    Picture.DELAY: cross_correlation,
    Picture.RESPONSE: frequency_response,
    **{picture: law_picture(law) for picture, law in LAWS.items()},
}


def finding_figure(diagnosis: Diagnosis, term: Term) -> Captioned:
    """Draw the evidence for a term of the final hypothesis, on all recordings: a law needs every feed and position."""
    runs = (*diagnosis.train.runs, *diagnosis.held_out.runs)
    views = [view_of(diagnosis, run, term) for run in runs]
    wanted = BY_ID[term.effect].text.picture
    slides = any(view.torque.sliding[view.run.evaluated].any() for view in views)
    if not slides or (wanted is Picture.LOST_MOTION and not views[0].has_table):  # no law can be drawn of that
        wanted = Picture.TIME
    figure, caption = PICTURES[wanted](diagnosis, views)
    return Captioned(labelled(figure, diagnosis.given_bench.axis.turns), caption)
