"""Spellings of units in files, and the unit that the name of a column holds."""

import re
import unicodedata

from hil.quantities import UNITS

# spellings in lower case, without blanks, brackets and multiplication signs -> unit of a map
_SPELLINGS = {
    "s": "s sec secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondi",
    "ms": "ms msec millis millisecond milliseconds millisekunden",
    "us": "us usec µs microseconds mikrosekunden",
    "ns": "ns nsec nanoseconds",
    "min": "min minutes minuten",
    "m": "m meter metre metres meters mètre",
    "mm": "mm millimeter millimetre",
    "um": "um µm micron microns mikrometer",
    "nm": "nanometer nanometre",
    "in": "inch inches",
    "ft": "ft foot feet",
    "rad": "rad radian radians radianes radianti radiant",
    "mrad": "mrad",
    "deg": "deg degree degrees ° grad degre degres degré degrés grado grados gradi",
    "mdeg": "mdeg millideg millidegree millidegrees m° mgrad",
    "arcmin": "arcmin arcminutes",
    "arcsec": "arcsec arcseconds",
    "rev": "rev revs revolutions turn turns tr tours umdr umdrehungen u vueltas giri",
    "m/s": "m/s mps m_s ms-1 ms^-1",
    "mm/s": "mm/s mm_s mms-1",
    "um/s": "um/s µm/s um_s",
    "m/min": "m/min m_min",
    "mm/min": "mm/min mm_min",
    "in/s": "in/s in_s ips inch/s",
    "in/min": "in/min in_min ipm inch/min",
    "ft/s": "ft/s ft_s fps",
    "ft/min": "ft/min ft_min fpm",
    "rad/s": "rad/s rad_s rads-1 rads^-1",
    "deg/s": "deg/s °/s deg_s grad/s degre/s degres/s grados/s gradi/s",
    "rev/s": "rev/s rps u/s tr/s rev_s",
    "rpm": "rpm u/min 1/min min-1 min^-1 /min tr/min t/min u_min tr_min rev/min",
    "m/s^2": "m/s^2 m/s2 m/s² m_s2",
    "mm/s^2": "mm/s^2 mm/s2 mm/s² mm_s2",
    "rad/s^2": "rad/s^2 rad/s2 rad/s² rad_s2",
    "deg/s^2": "deg/s^2 deg/s2 °/s² deg_s2",
    "N m": "nm n_m newtonmeter",
    "mN m": "mnm mn_m",
    "N cm": "ncm n_cm",
    "kN m": "knm kn_m",
    "N": "n newton",
    "kN": "kn",
    "kgf": "kgf kp",
    "lbf": "lbf lb lbs",
    "kgf m": "kgfm kgf_m kgf-m kpm",
    "kgf cm": "kgfcm kgf_cm kgf-cm kpcm",
    "lbf ft": "lbfft lbf_ft lbf-ft ftlbf ft_lbf ft-lbf lbft lb_ft lb-ft ftlb ft_lb ft-lb ftlbs ft-lbs",
    "lbf in": "lbfin lbf_in lbf-in inlbf in_lbf in-lbf lbin lb_in lb-in inlb in_lb in-lb inlbs in-lbs",
    "ozf in": "ozfin ozf_in ozf-in inozf in_ozf in-ozf ozin oz_in oz-in inoz in_oz in-oz",
    "A": "a amp amps ampere arms a_rms apk aeff a_eff",
    "mA": "ma",
    "V": "v volt volts",
    "mV": "mv",
    "%": "% percent pct prozent",
    "permille": "‰ permille promille 0.1%",
    "counts": "counts count cts cnt cnts inc incs inkr inkremente increments ticks pulses impulse lsb",
}
_UNIT_OF = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings.split()}
_KIND = {
    "s": "time",
    "m": "position",
    "rad": "position",
    "m/s": "velocity",
    "rad/s": "velocity",
    "m/s^2": "acceleration",
    "rad/s^2": "acceleration",
    "N m": "effort",
    "N": "effort",
}
_ELECTRIC = ("A", "mA", "V", "mV", "%", "permille")
QUANTITY_OF_UNIT = (
    {unit: _KIND[si] for unit, (si, _) in UNITS.items() if si in _KIND}
    | {"counts": "position"}
    | dict.fromkeys(_ELECTRIC, "effort")
)
# one letter at the end of a name is a unit only after a word: x_m may be in metres, q_m of the motor
_BRACKETS = re.compile(r"[\[(<{]\s*([^\])>}]*)\s*[\])>}]\s*$")
_BITS = re.compile(r"(?<=[a-z])\d+(bit)?$")  # counts16bit
_SLASH = re.compile(r"^\s*[^/\s]+\s*/\s*(\S+)\s*$")  # DIN 461: x/mm
_WORD_IN = re.compile(r"\bin\s+(\S+)\s*$")  # Weg in mm


def unit_named(text: str) -> str | None:
    """Unit of a map for a spelling in a file; None for an unknown one."""
    key = unicodedata.normalize("NFKC", text).strip().lower().replace("μ", "µ")
    key = re.sub(r"[\s·*⋅.]+", "", key)
    if key.startswith("%"):  # % of what is told by no spelling
        return "%"
    counts = _UNIT_OF.get(_BITS.sub("", key)) == "counts"
    return "counts" if counts else _UNIT_OF.get(key)


def split_unit(name: str) -> tuple[str, str | None, bool]:
    """Name without its unit, the unit if it has one, and True if a unit stands there that is not known."""
    for pattern in (_BRACKETS, _SLASH, _WORD_IN):
        match = pattern.search(name)
        if match:
            unit = unit_named(match[1]) or ("in" if match[1].strip().lower() == "in" else None)  # elsewhere a word
            rest = name[: match.start()].strip() if pattern is not _SLASH else name.split("/")[0].strip()
            if unit or pattern is _BRACKETS:
                return rest, unit, unit is None and match[1].strip() not in ("", "-", "1")
    tokens = name.split("_")
    for take in (3, 2, 1):
        if len(tokens) > take:
            unit = unit_named("_".join(tokens[-take:]).replace("°", "deg"))
            if unit and unit not in ("rev", "min"):
                return "_".join(tokens[:-take]), unit, False
    return name, None, False
