"""The summary of a run as an xarray.Dataset."""

import xarray as xr

from tolcontact.readable import Pictured
from tolcontact.statistics.summary import estimates_of


class Summary(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset that a notebook shows as tables."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return Pictured.picture(self)


def summarize(results: xr.DataTree) -> Summary:
    """Return the statistics of a run, each as (estimate, lower, upper) with a 95 % interval.

    statistic_value (measure, state, statistic, interval) in the measure's units; shares are of 1
    change          (measure, change_of, interval)         from raw to corrected, over the same realizations
    touched         (interval)                           share of realizations that contact touched
    by_status       (status_meaning)                     number of realizations
    not_assemblable (interval)                           share of realizations without a pose free of penetration
    conflicts       (pair)                               number of these with the pair in conflict
    penetration     (state)                              largest true penetration in a pair that is not compliant [mm]
    watched                                              number of realizations whose bodies were tested for interference
    clash_share     (interval)                           share of these with penetration between parts without contact
    clash_count, clash_largest_depth (clash)             number of realizations with two parts as the deepest pair, depth [mm]
    clash_declared  (clash)                              1: their contact is declared, and these realizations are doubtful
    surface_penetration, beside   largest values in the realizations that were checked against the surfaces [mm]: the depth of a
                                  face in the other body, and the distance of touching contact points outside the face
    surfaces_checked              number of these realizations
    penetrating_share, false_contact_share   (interval)  shares of realizations whose surfaces penetrate each other, or were
                                  apart in the raw state where contact was resolved, by more than 1 % of the smallest range;
                                  from the realizations that were checked at random
    contacts, contacts_ended      in the checked realizations: number of contact points that touch, and number of these that
                                  touch a plane beyond the end of its face; NaN where unknown
    false_contact   (pair)                               in the checked realizations: depth of contact points in the raw state
                                                         where the surfaces were apart [mm]; NaN where unknown
    carried         (pair, interval)                     share of realizations with a pair under load
    reaction        (pair, of_reaction, interval)        mean and percentiles of its reaction, in the objective's units
    together        (combination, interval)              share of realizations with exactly these pairs under load
    iterations      (of_iterations)                      median and largest number of linear steps of touched realizations
    field_extreme   (part, state, extreme, interval)     least and largest 6 sigma of the displacement magnitude [mm]
    field_realizations                                   number of realizations in the displacement fields,
    magnitude_realizations                               and in their magnitudes

    The attribute `realizations` is the number of finished realizations, `samples` the number that the run was started with.
    Raises ArchiveError if fewer than MIN_REALIZATIONS realizations are finished.
    """
    dataset = estimates_of(results)
    return Summary(dataset.data_vars, dataset.coords, dataset.attrs)
