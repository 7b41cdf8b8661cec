"""The AP242 file of the guide's tutorial: models/cover.step with tolerances as data.

python studies/pictures/cover_pmi.py FILE.stp
"""

import sys
from pathlib import Path

from tests.pmi_records import Annotated

COVER = Path(__file__).parents[2] / "models" / "cover.step"
ROUND = "cylindrical or circular"


def main() -> None:
    file = Annotated(COVER.read_text(encoding="utf-8"))
    for letter, face in {"A": 5, "B": 6, "C": 1}.items():
        file.datum(letter, face)
    hole = file.aspect(11)
    file.size(hole, 8.1, (0, 0.03))
    file.tolerance("position", 0.2, hole, "A|B|C", zone=ROUND, modifier="M")
    file.tolerance("surface_profile", 0.4, file.aspect(10), "A|B|C")
    file.tolerance("surface_profile", 0.4, file.aspect(7), "A|B|C")
    file.write(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
