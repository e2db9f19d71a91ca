"""All constants of evidence: on which a name, a verdict, a confidence or a location rests."""

from dataclasses import dataclass

from hil.identification.inference import ALIKE, TIED
from hil.identification.law.result import REPLAYED
from hil.identification.least_squares import SIGMAS
from hil.identification.noise_floor import COLOURED, FLOOR, REPEATS
from hil.identification.residual_scales import DISCREPANCY


@dataclass(frozen=True)
class Criteria:
    """All constants of evidence. Energies per row are in units of noise^2, evidence is a BIC difference.

    Those that a fit needs by itself are defined in `hil.identification`, with their reasons.
    """

    floor: float = FLOOR  # mean square over noise up to which a channel is explained
    coloured: float = COLOURED  # the same beside a noisy torque, if what is left depends on nothing
    repeats: float = REPEATS  # least ratio of what differs from lap to lap, without a term over with it
    tied: float = TIED  # evidence from which a rival is refuted
    alike: float = ALIKE  # energy per row up to which it is not
    replayed: float = REPLAYED  # share of the command (rms) that the control law of a recording leaves at most

    # Evidence of a term. "Very strong" is 10 (Kass and Raftery 1995); the search looks at some 45 variants at some 90
    # starts, which costs 2 log 90 = 9 more.
    evidence: float = 20.0
    # Least energy per row that a term removes: 14 % of the noise in rms. The model discrepancy of two simulations of
    # one axis is below that. Below half of it nothing is left to explain.
    material: float = 0.02
    # Least share of the energy above the noise that a term removes, and the same beside `several` terms: many terms of
    # less are a series expansion of another effect; if `several` are right, a further effect is all that is left. Below
    # this share of the first candidate's score one is not fitted, and below this share of a falling friction law's
    # energy drag is part of its form: beside the best law fitted to an arctangent over 5 to 150 Stribeck velocities it
    # takes up to 1.3 %.
    worth: float = 0.02
    series: float = 0.1
    several: int = 2
    # Share of a removed energy, 1/20 in rms, below which the remainder may be due to another form of the same law.
    form: float = 0.0025
    clear: float = 0.7  # cost with a term over that without it, below which its evidence needs no converged fit
    most_left: float = 0.5  # share of the energy above the noise; terms or laws that leave more do not explain it
    in_vain: int = 3  # terms that leave more than `most_left`, after which the search ends
    # A channel pays if its mean square grows by 10 % in rms, which is above a trade within the model discrepancy, and
    # by a tenth of all that the term explains: a real effect leaves the others a little wrong as long as something is
    # missing, one that only trades between channels loses as it gains.
    worse: float = 1.1**2
    paid: float = 0.1

    # Share of the torque's deviation (rms) by which correct simulations of one axis differ: less is no worse.
    discrepancy: float = DISCREPANCY
    least_torque: float = 0.001  # share of the torque's deviation (rms) of the least structure or shape

    # Windows of a force: energy per row inside over that outside (twice the rms, for edges between two rows), share of
    # the energy inside that the best constant leaves of one push (0.19 of half a sine, 0.25 of a triangle), level over
    # the rms of the rest (1 in 10^6 of Gaussian blocks), energy of the faintest windows (3 % in rms).
    inside: float = 4.0
    push: float = 0.25
    stands_out: float = 5.0
    faint: float = 1e-3

    sigmas: float = SIGMAS  # standard errors from which a value differs: 0.3 % of Gaussian ones are above without cause
    on_motion: float = 0.5  # least share of a term's gain on motion without noise: about 1 where it acts on the motion
    acts: float = 0.1  # least change of held-out residuals per row, over that in training, from which a term acts there

    # Findings stand if they leave less than `little` of the energy above the noise, or little over `far`: this share
    # times the worst residual in noise rms, as 1/20 at 5 times the noise or 1/6 at 1.5. The true mechanism in another
    # form leaves less.
    little: float = 0.05
    far: float = 0.25
    # Largest mean square over noise on held-out recordings of a twin that lacks nothing: errors of fitted parameters
    # may leave as much rms there as the noise twice.
    elsewhere: float = 4.0
    change: float = 0.9  # of the energy above the noise that a change of the axis explains; less has another cause
    setting: float = 1e-3  # relative change of a gain that is a correction: settings have three digits
    visible: float = 2.0  # factor on the evidence that a designed motion must show, which is simulated

    # Closed-loop rms over its floor above which the loop counts as chaotic if the block is below: a margin for the
    # uncertainty of the closed-loop floor.
    strays: float = 1.15
    # Location: share of the energy in a window or a range (the rest is spread by the observer and by noise), largest
    # share of the motion that a range covers, and level of significance of a range.
    concentrated: float = 0.8
    narrow: float = 0.5
    significance: float = 0.01
    # Least share of a force on the table in the torque on the motor, and least correlation of both: on development axes
    # the share was 0.9 to 5 for forces, at most 0.6 for errors of the transmission, and 0.1 for errors of encoders. The
    # linear encoder is at fault below `missing`: its errors had at most 0.02, those of the transmission 0.5 and more.
    felt: float = 0.7
    correlated: float = 0.5
    missing: float = 0.25

    # Confidence, see `verdict.judge`: offset and weights of energy left, small gain and close rival. The last two:
    # maximum likelihood on 167 and 249 findings of development cases, between the two. The others: with them a term
    # that explains nearly all beside a large remainder is sure, and one of 5 % is not.
    offset: float = 4.5
    left_weight: float = 1.0
    gain_weight: float = 0.8
    rival_weight: float = 0.2
    structure: float = 10.0
    # Share of the torque missed on held-out motion that halves the odds of a term of little gain: of 562 names of real
    # recordings the wrong ones above 0.9 became 28 of 45, the right ones 191 of 199.
    missed: float = 0.03
    least_gain: float = 0.01  # a gain of 1 % is as weak as none
    plenty: float = 1000.0  # a rival at odds of exp(-500) is refuted whatever the model discrepancy
    likely: float = 0.5  # confidence from which an effect is called likely, not doubtful
    named: float = 0.2  # confidence below which it has no name: of 19 below on real recordings 2 were right

    @property
    def material_alone(self) -> float:
        """Least energy per row that a term removes from one channel: in one, two simulations differ by up to 0.03."""
        return 2.0 * self.material

    @property
    def nothing(self) -> float:
        """Energy above the noise per row below which nothing is left to explain."""
        return 0.5 * self.material


CRITERIA = Criteria()
