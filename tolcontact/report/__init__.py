"""Report: tables for a terminal, pages for a browser, and views for notebooks. A chapter of the guide.

`summary_text`, `comparison_text` and `runs_text` turn the datasets of `tc.summarize`, `tc.compare` and `tc.compare_runs` into
text that rich prints. Tables fit into 80 columns, or use the width of a wider terminal; output to files is never cut.

>>> import tolcontact as tc
>>> from rich.console import Console
>>> from tolcontact.report import summary_text
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
>>> results = tc.run(stand, samples=1000, seed=1)
>>> Console(width=80, highlight=False).print(summary_text(tc.summarize(results)))
variation simulation of stand: 1000 realizations
...

`write_page` (the command `tolcontact report`) writes a page for a browser, from an archive alone. The page is a single file
that needs no network and runs only its own scripts; commands replace files that are not pages only with `--overwrite`. It shows
the assembly in 3D, with fields, sections, and single realizations with their form deviations and the resulting gaps; histograms
with limits, and the convergence of estimates; measurements against contributors; contact, certificates, and the settings of the
run. `write_view` (`tolcontact view`) writes the assembly before a run: faces with their selectors, features with their
tolerances, locators, contact points, nominal gaps. A feature or a pattern that you choose in the list is highlighted on all of
its faces, and a face that you click on names its features. The model may still lack measures and locations of parts. In a
notebook, a declared assembly or a program shows this page, a summary shows its tables, and `results.tolcontact` shows the
report. `write_comparison` (`tolcontact compare A.nc B.nc --report`) writes a comparison of runs.

How to read the text:

- Each figure is `estimate [lower, upper]`, with the decimals that its 95 % interval supports.
- The first table gives mean, 6 sigma, Ppk and the share out of specification of each measurement: without contact, with parts
  as positioned by their locators even if they penetrate each other; and with contact, where no part penetrates another. The
  archive calls these states `raw` and `corrected`. A line for each measurement with limits states its verdict: the measurement
  meets the limits if the 95 % interval of the share out of specification, with contact, lies at or below 0.27 %; it does not if
  the interval lies above; otherwise the verdict is open, and the line states the number of realizations that would probably
  decide.
- The next tables give all statistics in both states, and the change between them. Changes compare the same draws, so their
  intervals are narrower than a comparison of the two columns suggests.
- Another table gives, for each part, the smallest and largest 6 sigma of the displacement over its surface.
- The last lines describe contact: the share of realizations touched by it, their statuses, the pairs in conflict, the largest
  penetration at contact points and between surfaces, and advice if another method is more suitable.

Realizations that did not converge, cannot be assembled, or are doubtful are included in the statistics; a line of the text
says so.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
