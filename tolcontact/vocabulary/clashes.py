"""Variables of parts that lie in each other though no contact between them is declared, for each realization."""

from tolcontact.vocabulary.labels import REALIZATION, ArchiveVariable

CLASHES = ArchiveVariable(
    "clashes",
    (REALIZATION,),
    "i2",
    "number of pairs of parts without declared contact that lie in each other in the corrected state; -1: not tested",
    "1",
)
CLASH_DEPTH = ArchiveVariable(
    "clash_depth",
    (REALIZATION,),
    "f8",
    "how deep the parts of the deepest of these pairs lie in each other; without such a pair, parts with declared contact "
    "whose answer is doubtful; 0: no parts; NaN: not measured",
    "mm",
)
CLASH_PART = ArchiveVariable(
    "clash_part",
    (REALIZATION,),
    "i2",
    "index along `part` of the first of the two parts that clash_depth is of; -1: no parts",
    "1",
)
CLASH_OTHER = ArchiveVariable(
    "clash_other", (REALIZATION,), "i2", "index along `part` of the second of these parts; -1: no parts", "1"
)
