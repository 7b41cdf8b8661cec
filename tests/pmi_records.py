"""PMI in the words of AP242, appended to the text of a STEP file."""

import re
from pathlib import Path

SCHEMA = "FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }'));"
MATERIALS = {"M": "MAXIMUM_MATERIAL_REQUIREMENT", "L": "LEAST_MATERIAL_REQUIREMENT", "F": "FREE_STATE"}
FIRST = 90_000  # number of the first record


class Annotated:
    """A STEP file with PMI in the making. Faces are numbered from 1, in the order of the shells of the file.

    `add` gives an entity its number, and every method returns the number of what it adds.
    """

    def __init__(self, text: str) -> None:
        self.text = re.sub(r"FILE_SCHEMA\(.*?\);", SCHEMA, text, flags=re.DOTALL)
        shells = re.findall(r"(?:CLOSED|OPEN)_SHELL\s*\('[^']*',\((.*?)\)", text, re.DOTALL)
        self.faces = [int(number) for shell in shells for number in re.findall(r"#(\d+)", shell)]
        self.mm = int(re.search(r"#(\d+)\s*=\s*\(\s*LENGTH_UNIT", text)[1])
        self.context = int(re.search(r"#(\d+)\s*=\s*\(\s*GEOMETRIC_REPRESENTATION_CONTEXT\s*\(\s*3", text)[1])
        self.lines: list[str] = []
        self.letters: dict[str, int] = {}

    def add(self, entity: str) -> int:
        self.lines.append(entity)
        return FIRST + len(self.lines) - 1

    def length(self, value: float) -> int:
        return self.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({float(value)!r}),#{self.mm})")

    def aspect(self, *faces: int, kind: str = "SHAPE_ASPECT('','',#1,.T.)") -> int:
        number = self.add(kind)
        for face in faces:
            self.add(f"GEOMETRIC_ITEM_SPECIFIC_USAGE('',$,#{number},#1,#{self.faces[face - 1]})")
        return number

    def datum(self, letter: str, *faces: int) -> None:
        self.letters[letter] = self.add(f"DATUM('',$,#1,.F.,'{letter}')")
        if faces:
            feature = self.aspect(*faces, kind="DATUM_FEATURE('','',#1,.T.)")
            self.add(f"SHAPE_ASPECT_RELATIONSHIP('',$,#{feature},#{self.letters[letter]})")

    def targets(self, letter: str, *points: tuple[float, float, float]) -> None:
        """A datum by points."""
        self.datum(letter)
        for label, point in enumerate(points, start=1):
            target = self.add(f"PLACED_DATUM_TARGET_FEATURE('','point',#1,.T.,'{label}')")
            self.add(f"SHAPE_ASPECT_RELATIONSHIP('',$,#{target},#{self.letters[letter]})")
            at = self.add(f"CARTESIAN_POINT('',({','.join(repr(float(x)) for x in point)}))")
            placement = self.add(f"AXIS2_PLACEMENT_3D('',#{at},$,$)")
            shape = self.add(f"SHAPE_REPRESENTATION_WITH_PARAMETERS('',(#{placement}),#{self.context})")
            definition = self.add(f"PROPERTY_DEFINITION('','',#{target})")
            self.add(f"SHAPE_DEFINITION_REPRESENTATION(#{definition},#{shape})")

    def system(self, text: str) -> int:
        """A datum system, as in "A|B(M)|C-D"."""
        compartments = []
        for compartment in text.split("|"):
            letters, _, material = compartment.rstrip(")").partition("(")
            modifier = f"(SIMPLE_DATUM_REFERENCE_MODIFIER(.{MATERIALS.get(material, material)}.))" if material else "$"
            bases = [f"#{self.letters[letter]}" for letter in letters.split("-")]
            if len(bases) > 1:
                elements = [self.add(f"DATUM_REFERENCE_ELEMENT('',$,#1,.F.,{base},$)") for base in bases]
                bases = [f"COMMON_DATUM_LIST(({','.join(f'#{element}' for element in elements)}))"]
            compartments.append(self.add(f"DATUM_REFERENCE_COMPARTMENT('',$,#1,.F.,{bases[0]},{modifier})"))
        return self.add(f"DATUM_SYSTEM('',$,#1,.F.,({','.join(f'#{number}' for number in compartments)}))")

    def tolerance(
        self, kind: str, value: float, aspect: int, datums: str = "", *others: str, zone: str = "", modifier: str = ""
    ) -> int:
        """A geometric tolerance of an aspect; `others` are entities of the same record."""
        entities = [f"GEOMETRIC_TOLERANCE('','',#{self.length(value)},#{aspect})", *others, f"{kind.upper()}_TOLERANCE()"]
        if datums:
            entities.append(f"GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#{self.system(datums)}))")
        if modifier:
            entities.append(f"GEOMETRIC_TOLERANCE_WITH_MODIFIERS((.{MATERIALS.get(modifier, modifier)}.))")
        number = self.add(f"({''.join(entities)})")
        if zone:
            form = self.add(f"TOLERANCE_ZONE_FORM('{zone}')")
            self.add(f"TOLERANCE_ZONE('',$,#1,.F.,(#{number}),#{form})")
        return number

    def composite(self, upper: int, lower: int) -> int:
        return self.add(f"GEOMETRIC_TOLERANCE_RELATIONSHIP('composite','',#{upper},#{lower})")

    def size(self, aspect: int, nominal: float, deviations: tuple[float, float] | None = None, name: str = "diameter") -> int:
        """A size with its lower and its upper deviation, or without limits."""
        number = self.add(f"DIMENSIONAL_SIZE(#{aspect},'{name}')")
        item = self.add(
            "(LENGTH_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()"
            f"MEASURE_WITH_UNIT(LENGTH_MEASURE({float(nominal)!r}),#{self.mm})REPRESENTATION_ITEM('nominal value'))"
        )
        shape = self.add(f"SHAPE_DIMENSION_REPRESENTATION('',(#{item}),#{self.context})")
        self.add(f"DIMENSIONAL_CHARACTERISTIC_REPRESENTATION(#{number},#{shape})")
        if deviations is not None:
            lower, upper = map(self.length, deviations)
            limits = self.add(f"TOLERANCE_VALUE(#{lower},#{upper})")
            self.add(f"PLUS_MINUS_TOLERANCE(#{limits},#{number})")
        return number

    def fit(self, aspect: int, nominal: float, letters: str, grade: str, variance: str = "", name: str = "diameter") -> None:
        """A size with the class of a fit."""
        fit = self.add(f"LIMITS_AND_FITS('{letters}','{variance}','{grade}','')")
        self.add(f"PLUS_MINUS_TOLERANCE(#{fit},#{self.size(aspect, nominal, name=name)})")

    def write(self, path: Path) -> Path:
        records = "".join(f"#{number}={entity};\n" for number, entity in enumerate(self.lines, start=FIRST))
        end = self.text.rindex("ENDSEC;")
        path.write_text(self.text[:end] + records + self.text[end:])
        return path
