"""The modifiers of tolerances and datums that a drawing can state: their signs, and how features declare them."""

from typing import Any, NamedTuple


class Modifier(NamedTuple):
    """A modifier of a tolerance, or of a datum.

    sign      on a drawing
    standard  that defines it
    declared  options of a tolerance (see GeometricTolerance) or the mark of a datum; or the reason why it is not declared
    meaning   of a modifier without options or mark
    remark    on what is declared with it
    """

    sign: str
    standard: str
    declared: dict[str, Any] | str
    meaning: str = "declared; it changes nothing here"
    remark: str = ""

    @property
    def outcome(self) -> str:
        """How it is declared, in words."""
        if isinstance(self.declared, str):
            return f"not declared: {self.declared}"
        if mark := self.declared.get("mark"):
            return f'`"A{mark}"`'
        return ", ".join(f"`{name}={value!r}`" for name, value in self.declared.items() if name != "mark") or self.meaning


THREADS = "threads have no such surface here"
FITTED = "zones are for surfaces as they are, and for their axes by least squares"
RIGID = "it is for the part in its free state; here the part is rigid and stays so when it is assembled"
CUSTOMIZED = "a datum locks all the freedoms that it can here, and not some of them alone"

# By their words in AP242.
OF_TOLERANCES = {
    "maximum material requirement": Modifier("M", "ISO 2692", {"material": "M"}),
    "least material requirement": Modifier("L", "ISO 2692", {"material": "L"}),
    "reciprocity requirement": Modifier("R", "ISO 2692", "sizes do not grow by what their zones leave unused"),
    "common zone": Modifier("CZ", "ISO 5458", {}, "one pattern of the features that its faces form"),
    "separate zone": Modifier("SZ", "ISO 5458", {}, "declared; positions of several features are one pattern all the same"),
    "simultaneous requirement": Modifier("SIM", "ISO 5458", {"simultaneous": True}),
    "separate requirement": Modifier("SEP REQT", "ASME Y14.5", {"simultaneous": False}),
    "statistical tolerance": Modifier("ST", "ASME Y14.5", {}),  # all draws are statistical
    "tangent plane": Modifier("T", "ASME Y14.5", {"tangent": True}),
    "free state": Modifier("F", "ISO 10579", {}, "declared, with a remark: parts are rigid here", RIGID),
    "unequally disposed": Modifier("UZ", "ISO 1660", "its displacement is not stated"),
    "offset zone": Modifier("OZ", "ISO 1660", "the offset of its zone is not stated, so that no displacement can be drawn"),
    "variable angle": Modifier("VA", "ISO 1660", "the angle of its zone is not stated, so that no displacement can be drawn"),
    "dynamic profile": Modifier("△", "ASME Y14.5", "the size of its zone is not stated, so that no displacement can be drawn"),
    "united feature": Modifier(
        "UF", "ISO 1101", "several surfaces count as one; declare them as a pattern with combined zones"
    ),
    "any cross section": Modifier("ACS", "ISO 1101", "it is for sections, and zones here are for whole surfaces"),
    "line element": Modifier("LE", "ISO 1101", "it is for lines, and zones here are for whole surfaces"),
    "each radial element": Modifier("EACH RADIAL ELEMENT", "ASME Y14.5", "it is for lines, and zones here are for surfaces"),
    "not convex": Modifier("NC", "ISO 1101", "forms are drawn convex and concave alike"),
    "major diameter": Modifier("MD", "ISO 1101", THREADS),
    "minor diameter": Modifier("LD", "ISO 1101", THREADS),
    "pitch diameter": Modifier("PD", "ISO 1101", THREADS),
    "associated minmax feature": Modifier("C", "ISO 1101", FITTED),
    "associated least square feature": Modifier("G", "ISO 1101", {}),
    "associated minimum inscribed feature": Modifier("N", "ISO 1101", FITTED),
    "associated maximum inscribed feature": Modifier("X", "ISO 1101", FITTED),
    "associated tangent feature": Modifier("T", "ISO 1101", {"tangent": True}),
}
OF_DATUMS = {
    "maximum material requirement": Modifier("M", "ISO 2692", {"mark": "(M)"}),
    "least material requirement": Modifier("L", "ISO 2692", {"mark": "(L)"}),
    "orientation": Modifier("><", "ISO 5459", {"mark": "><"}),
    "translation": Modifier("▷", "ASME Y14.5", "a datum whose simulator may translate locks no place, which is not declared"),
    "distance variable": Modifier("DV", "ISO 5459", "the distance within a common datum is fixed here"),
    "contacting feature": Modifier("CF", "ISO 5459", "a datum follows from its own surface here"),
    "any cross section": Modifier("ACS", "ISO 5459", "it is for sections, and datums here are whole surfaces"),
    "any longitudinal section": Modifier("ALS", "ISO 5459", "it is for sections, and datums here are whole surfaces"),
    "point": Modifier("PT", "ISO 5459", "of a situation feature all freedoms count here"),
    "line": Modifier("SL", "ISO 5459", "of a situation feature all freedoms count here"),
    "plane": Modifier("PL", "ISO 5459", "of a situation feature all freedoms count here"),
    "basic": Modifier("TED", "ASME Y14.5", "the size of a datum's simulator is not read"),
    "free state": Modifier("F", "ISO 10579", {"mark": ""}),  # a rigid part has one state
    "major diameter": Modifier("MD", "ISO 5459", THREADS),
    "minor diameter": Modifier("LD", "ISO 5459", THREADS),
    "pitch diameter": Modifier("PD", "ISO 5459", THREADS),
    **{f"degree of freedom constraint {letter}": Modifier(letter, "ASME Y14.5", CUSTOMIZED) for letter in "xyzuvw"},
}  # fmt: skip


def sign(modifier: str) -> str:
    """Return the sign of a modifier on a drawing, such as M, or the modifier itself."""
    known = OF_TOLERANCES.get(modifier) or OF_DATUMS.get(modifier)
    return modifier if known is None else known.sign
