"""Texts of STEP files of blocks, written by hand."""

import itertools
import re
from collections.abc import Sequence

FACES = (
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)  # corners of a block, seen from outside
WEDGE = ((0, 0, 0), (40, 0, 0), (0, 20, 0), (0, 0, 10))
WEDGE_FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','2026-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""


class Step:
    """A STEP file in the making: `add` gives an entity its number, after the `first` ones of another file."""

    def __init__(self, first=0):
        self.lines, self.first = [""] * first, first
        self.application = self.add("APPLICATION_CONTEXT('automotive design')")
        self.add(f"APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#{self.application})")
        self.millimetre = self.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
        self.angles = [
            self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))"),
            self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())"),
        ]
        self.context = self.context_in(self.millimetre)

    def add(self, entity):
        self.lines.append(entity)
        return len(self.lines)

    def context_in(self, unit):
        """The context of shapes in a unit of length."""
        accuracy = self.add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),#{unit},'distance_accuracy_value','')")
        units = ",".join(f"#{k}" for k in (unit, *self.angles))
        return self.add(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{accuracy}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({units}))REPRESENTATION_CONTEXT('',''))"
        )

    def inch(self):
        """The unit of an inch."""
        size = self.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
        length = self.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#{self.millimetre})")
        return self.add(f"(CONVERSION_BASED_UNIT('INCH',#{length})LENGTH_UNIT()NAMED_UNIT(#{size}))")

    def point(self, at):
        return self.add(f"CARTESIAN_POINT('',({','.join(f'{float(x)!r}' for x in at)}))")

    def direction(self, along):
        return self.add(f"DIRECTION('',({','.join(f'{float(x)!r}' for x in along)}))")

    def placement(self, at=(0, 0, 0), z=(0, 0, 1), x=(1, 0, 0)):
        return self.add(f"AXIS2_PLACEMENT_3D('',#{self.point(at)},#{self.direction(z)},#{self.direction(x)})")

    def shell(self, corners, kind="CLOSED_SHELL", faces=FACES):
        """A shell of flat `faces`, tuples of indices of `corners`, anticlockwise from outside."""
        vertices = [self.add(f"VERTEX_POINT('',#{self.point(corner)})") for corner in corners]
        edges, own = {}, []
        for face in faces:
            around = []
            for start, end in zip(face, (*face[1:], face[0]), strict=True):
                if (end, start) in edges:
                    around.append(self.add(f"ORIENTED_EDGE('',*,*,#{edges[end, start]},.F.)"))
                    continue
                along = [b - a for a, b in zip(corners[start], corners[end], strict=True)]
                vector = self.add(f"VECTOR('',#{self.direction(along)},1.)")
                line = self.add(f"LINE('',#{self.point(corners[start])},#{vector})")
                edges[start, end] = self.add(f"EDGE_CURVE('',#{vertices[start]},#{vertices[end]},#{line},.T.)")
                around.append(self.add(f"ORIENTED_EDGE('',*,*,#{edges[start, end]},.T.)"))
            a, b, c = (corners[k] for k in face[:3])
            x, y = ([q - p for p, q in zip(a, end, strict=True)] for end in (b, c))
            z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
            plane = self.add(f"PLANE('',#{self.placement(a, z, x)})")
            loop = self.add(f"EDGE_LOOP('',({','.join(f'#{k}' for k in around)}))")
            bound = self.add(f"FACE_OUTER_BOUND('',#{loop},.T.)")
            own.append(self.add(f"ADVANCED_FACE('',(#{bound}),#{plane},.T.)"))
        return self.add(f"{kind}('',({','.join(f'#{k}' for k in own)}))")

    def wedge(self, faces=()):
        """A solid without a mirror plane, WEDGE, whose faces have names."""
        shell = self.shell(WEDGE, faces=WEDGE_FACES)
        for face, name in zip(re.findall(r"#(\d+)", self.lines[shell - 1]), faces, strict=False):
            self.lines[int(face) - 1] = self.lines[int(face) - 1].replace("('',", f"('{name}',", 1)
        return self.add(f"MANIFOLD_SOLID_BREP('wedge',#{shell})")

    def solid(self, lower, upper, name="", void=None):
        outer = self.shell(corners(lower, upper))
        if void is None:
            return self.add(f"MANIFOLD_SOLID_BREP('{name}',#{outer})")
        inner = self.add(f"ORIENTED_CLOSED_SHELL('',*,#{self.shell(corners(*void))},.F.)")
        return self.add(f"BREP_WITH_VOIDS('{name}',#{outer},(#{inner}))")

    def sheet(self, at, size):
        """A square, seen from above, at a height of its own."""
        x, y, z = at
        square = [(x, y, z), (x + size, y, z), (x + size, y + size, z), (x, y + size, z)]
        shell = self.shell(square, "OPEN_SHELL", [(0, 1, 2, 3)])
        return self.add(f"SHELL_BASED_SURFACE_MODEL('',(#{shell}))")

    def ball(self, radius):
        """A solid ball, whose face has its seam from pole to pole."""
        poles = [self.add(f"VERTEX_POINT('',#{self.point((0, 0, z))})") for z in (-radius, radius)]
        circle = self.add(f"CIRCLE('',#{self.placement(z=(0, -1, 0), x=(0, 0, -1))},{float(radius)!r})")
        seam = self.add(f"EDGE_CURVE('',#{poles[0]},#{poles[1]},#{circle},.T.)")
        around = [self.add(f"ORIENTED_EDGE('',*,*,#{seam},.{sense}.)") for sense in "TF"]
        loop = self.add(f"EDGE_LOOP('',(#{around[0]},#{around[1]}))")
        bound = self.add(f"FACE_OUTER_BOUND('',#{loop},.T.)")
        sphere = self.add(f"SPHERICAL_SURFACE('',#{self.placement()},{float(radius)!r})")
        face = self.add(f"ADVANCED_FACE('',(#{bound}),#{sphere},.T.)")
        shell = self.add(f"CLOSED_SHELL('',(#{face}))")
        return self.add(f"MANIFOLD_SOLID_BREP('',#{shell})")

    def double(self, shell):
        """Let the first face of a shell stand in it a second time."""
        first = int(re.search(r"\(#(\d+)", self.lines[shell - 1])[1])
        again = self.add(self.lines[first - 1])
        self.lines[shell - 1] = self.lines[shell - 1].replace("))", f",#{again}))")

    def paint(self, shell, red):
        """Give the first face of a shell a colour of its own."""
        face = int(re.search(r"\(#(\d+)", self.lines[shell - 1])[1])
        colour = self.add(f"COLOUR_RGB('',{red},0.,0.)")
        fill = self.add(f"FILL_AREA_STYLE_COLOUR('',#{colour})")
        area = self.add(f"FILL_AREA_STYLE('',(#{fill}))")
        side = self.add(f"SURFACE_SIDE_STYLE('',(#{self.add(f'SURFACE_STYLE_FILL_AREA(#{area})')}))")
        use = self.add(f"SURFACE_STYLE_USAGE(.BOTH.,#{side})")
        style = self.add(f"PRESENTATION_STYLE_ASSIGNMENT((#{use}))")
        styled = self.add(f"STYLED_ITEM('color',(#{style}),#{face})")
        self.add(f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(#{styled}),#{self.context})")

    def product(self, name, items: Sequence[int] = (), units=None):
        """A product whose shape has some items, in a context of units. Returns its definition and its representation."""
        context = self.add(f"PRODUCT_CONTEXT('',#{self.application},'mechanical')")
        product = self.add(f"PRODUCT('{name}','{name}','',(#{context}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        stage = self.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{self.application},'design')")
        definition = self.add(f"PRODUCT_DEFINITION('design','',#{formation},#{stage})")
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
        placed = ",".join(f"#{k}" for k in (self.placement(), *items))
        kind = "ADVANCED_BREP_SHAPE_REPRESENTATION" if items else "SHAPE_REPRESENTATION"
        representation = self.add(f"{kind}('',({placed}),#{units or self.context})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})")
        return definition, representation

    def operator(self, transform, scale="$"):
        """The operator that places a copy by a transform (4, 4), which may mirror."""
        x, y, z, at = (transform[:3, k] for k in range(4))
        axes = [self.direction(axis) for axis in (x, y, z)]
        return self.add(
            f"CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',#{axes[0]},#{axes[1]},#{self.point(at)},{scale},#{axes[2]})"
        )

    def place(self, child, parent, name, at=(0, 0, 0), operator=None):
        """Put one product into another one, both as `product` gives them, at a point or by an operator."""
        use = self.add(f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{name}','{name}','',#{parent[0]},#{child[0]},$)")
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',#{use})")
        moved = operator or self.add(f"ITEM_DEFINED_TRANSFORMATION('','',#{self.placement()},#{self.placement(at)})")
        related = self.add(
            f"(REPRESENTATION_RELATIONSHIP('','',#{child[1]},#{parent[1]})"
            f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{moved})SHAPE_REPRESENTATION_RELATIONSHIP())"
        )
        self.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{related},#{shape})")

    def image(self, child, transform):
        """A product that consists of the image of another one by a transform (4, 4)."""
        source = self.add(f"REPRESENTATION_MAP(#{self.placement()},#{child[1]})")
        return self.product("image", [self.add(f"MAPPED_ITEM('',#{source},#{self.operator(transform)})")])

    @property
    def records(self):
        """The records, as they stand in the file."""
        return "".join(f"#{k}={self.lines[k - 1]};\n" for k in range(self.first + 1, len(self.lines) + 1))

    def __str__(self):
        return f"{HEADER}{self.records}ENDSEC;\nEND-ISO-10303-21;\n"


def corners(lower, upper):
    """The eight corners of a block, in the order that FACES counts on."""
    (x, y), (u, v) = lower[:2], upper[:2]
    return [(*at, z) for z, at in itertools.product((lower[2], upper[2]), ((x, y), (u, y), (u, v), (x, v)))]


def step_of(*items):
    """A STEP file of one product: `items` are names of methods of Step, and what they are called with."""
    made = Step()
    made.product("part", [getattr(made, method)(*arguments) for method, *arguments in items])
    return str(made)


def step_block():
    return step_of(("solid", (0, 0, 0), (10, 20, 30), "block"))


def assembly(*places):
    """A file in which products stand at some places: (name, at) each."""
    made = Step()
    solids = {
        "pin": [((0, 0, 0), (5, 5, 5))],
        "set": [
            ((0, 0, 0), (10, 10, 10)),
            ((10, 0, 0), (20, 10, 10)),
            ((0, 0, 20), (30, 30, 50), "", ((10, 10, 30), (20, 20, 40))),
        ],
    }
    names = dict.fromkeys(name for name, _ in places)
    products = {name: made.product(name, [made.solid(*solid) for solid in solids[name]]) for name in names}
    whole = made.product("whole")
    for k, (name, at) in enumerate(places):
        made.place(products[name], whole, f"use {k}", at)
    return str(made)
