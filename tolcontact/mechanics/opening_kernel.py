"""The openings of rows between elastic parts under reactions."""

from tolcontact.compiled import compiled


@compiled
def add_openings(C, reactions, openings):  # type: ignore[no-untyped-def]
    """Add C l to the openings (realization, row) [mm], with C (row, row) [mm/N], for reactions l (realization, row) [N].

    Sums run over the rows under load in their order, so that a realization does not depend on the others.
    """
    for k in range(len(reactions)):
        for row in range(len(C)):
            load = reactions[k, row]
            if load != 0.0:
                for i in range(len(C)):
                    openings[k, i] += load * C[row, i]
