"""Plot: pictures for papers and slides, with `tc.plot`. A chapter of the guide. Needs `pip install '.[plot]'`.

`tc.plot.histogram` draws with matplotlib into your `axes` or new ones. `tc.plot.assembly` and `tc.plot.field` draw with pyvista
into your `plotter`, or into a new one that needs no display. You can add anything that these libraries offer, and save it:

    tc.plot.histogram(results, "corner height").figure.savefig("height.pdf")
    tc.plot.field(results, component="z", state="corrected").screenshot("field.png")
    tc.plot.assembly(results, realization=17, state="raw").screenshot("raw.png")

>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
>>> axes = tc.plot.histogram(tc.run(stand, samples=500, surfaces=0), "height")
>>> axes.get_xlabel(), axes.get_ylabel()
('height [mm]', '% of realizations')

The colours are safe for colour-blind readers: viridis, a diverging map where signs matter, and grey and orange for the states.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
