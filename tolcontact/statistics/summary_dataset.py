"""The summary of a run as an xarray.Dataset."""

import xarray as xr

from tolcontact.later import HTML, LATER
from tolcontact.statistics.summary import estimates_of


class Summary(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset that a notebook shows as tables."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return str(LATER[HTML](self))


def summarize(results: xr.DataTree) -> Summary:
    """Return the statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, interval) in the measure's units; shares are of 1
    change          (measure, change_of, interval)         corrected against raw, from the same realizations
    touched         (interval)                           share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    not_assemblable (interval)                           share of realizations without a pose free of penetration
    conflicts       (pair)                               in how many of these a pair is among those in conflict
    penetration     (state)                              largest true penetration in a pair that does not give way [mm]
    watched                                              number of realizations whose bodies were tested for interference
    clash_share     (interval)                           share of these in which parts without contact lie in each other
    clash_count, clash_largest_depth (clash)             in how many realizations two parts lie deepest, how deep [mm]
    clash_declared  (clash)                              1: their contact is declared, and these realizations are doubtful
    surface_penetration, beside   largest of the realizations that were checked against the surfaces [mm]: how deep a face lies
                                  in the other body, and how far contact points that touch stand beside the face
    surfaces_checked              number of these realizations
    penetrating_share, false_contact_share   (interval)  shares of realizations whose surfaces penetrate each other, or were
                                  apart in the raw state where contact was resolved, by more than 1 % of the smallest range;
                                  from those realizations that were checked at random
    contacts, contacts_ended      of the realizations checked: how many contact points touch, and how many of them a plane where
                                  its face has ended; NaN where that is not known
    false_contact   (pair)                               of these: how deep contact points lay inside in the raw state, where
                                                         the surfaces were apart [mm]; NaN where that is not known
    carried         (pair, interval)                     share of realizations in which a pair carries
    reaction        (pair, of_reaction, interval)        mean and percentiles of its reaction, in the objective's units
    together        (combination, interval)              share of realizations in which exactly these pairs carry
    iterations      (of_iterations)                      median and largest number of linear steps of those touched
    field_extreme   (part, state, extreme, interval)     least and largest 6 sigma of the displacement magnitude [mm]
    field_realizations                                   number of realizations in the displacement fields,
    magnitude_realizations                               and in their magnitudes

    The attribute `realizations` is the number of finished realizations, `samples` the number that the run was started with.
    Raises ArchiveError if fewer than MIN_REALIZATIONS realizations are finished.
    """
    dataset = estimates_of(results)
    return Summary(dataset.data_vars, dataset.coords, dataset.attrs)
