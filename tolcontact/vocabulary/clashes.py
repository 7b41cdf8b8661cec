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
    "how deep the parts of the deepest of these pairs lie in each other; 0: no such pair",
    "mm",
)
CLASH_PART = ArchiveVariable(
    "clash_part",
    (REALIZATION,),
    "i2",
    "index of the first part of the deepest of these pairs along `part`; -1: no such pair",
    "1",
)
CLASH_OTHER = ArchiveVariable(
    "clash_other", (REALIZATION,), "i2", "index of the second part of this pair along `part`; -1: no such pair", "1"
)
