"""Tolerances and dimensions of a STEP file as the CAD kernel reads them. Lengths in mm, angles in degrees.

`python -P step_annotations.py FILE MEMORY SECONDS` prints them as JSON. `tests.kernel_annotations` runs it, since the kernel
may crash at a damaged file.

The kernel does not say from which record an annotation comes, but it passes on the name of that record. Before the transfer,
each record of an annotation gets its place among all records as its name. The kernel then does not know a dimension by its
name ("diameter"), but it knows whether it is an angle.
"""

import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.StepDimTol import StepDimTol_GeometricTolerance
from OCP.StepShape import StepShape_DimensionalLocation, StepShape_DimensionalSize
from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
from OCP.TDF import TDF_AttributeIterator
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.XCAFDoc import (
    XCAFDoc_Datum,
    XCAFDoc_Dimension,
    XCAFDoc_DimTolTool,
    XCAFDoc_DocumentTool,
    XCAFDoc_GeomTolerance,
    XCAFDoc_ShapeTool,
)

from tolcontact.child import limit_resources

try:
    from OCP.collections import Sequence_TDF_Label as LabelSequence
except ModuleNotFoundError:  # release 7.9 of OCP
    from OCP.TDF import TDF_LabelSequence as LabelSequence

ANNOTATIONS = (StepDimTol_GeometricTolerance, StepShape_DimensionalLocation, StepShape_DimensionalSize)
# Words of the kernel where standards have others.
WORDS = {
    "circularity or roundness": "roundness", "profile of line": "line profile", "profile of surface": "surface profile",
    "m": "maximum material requirement", "l": "least material requirement", "none": "",
}  # fmt: skip
EXTENTS = ("all around", "all over")  # modifiers of the kernel that say to which faces a tolerance applies
PRESENTATIONS = ("CommonLabel", "DimensionPresentation")  # types of dimensions that are only drawn


class Document:
    """A STEP file and its annotations in the kernel's document. It owns all that is taken from it."""

    def __init__(self, path: Path) -> None:
        self.document = TDocStd_Document(TCollection_ExtendedString("STEP"))
        self.reader = STEPCAFControl_Reader()
        self.reader.SetGDTMode(True)
        for content in ("Name", "Color", "Layer", "Props", "Mat"):
            getattr(self.reader, f"Set{content}Mode")(False)
        if self.reader.ReadFile(str(path)) != IFSelect_RetDone:
            sys.exit("it is no STEP file, or damaged")
        session = self.reader.Reader().WS()
        model = session.Model()
        self.places = {model.Value(place): place for place in range(1, model.NbEntities() + 1)}
        for record, place in self.places.items():
            if isinstance(record, ANNOTATIONS):
                record.SetName(TCollection_HAsciiString(str(place)))
        if not self.reader.Transfer(self.document):
            sys.exit("it holds no shape")
        self.transfer = session.TransferReader()
        self.tool = XCAFDoc_DocumentTool.DimTolTool_s(self.document.Main())

    def tolerances(self) -> Iterator[dict[str, Any]]:
        """Yield the geometric tolerances, in the order of their records."""
        for label, tolerance in objects(self.tool.GetGeomToleranceLabels, XCAFDoc_GeomTolerance):
            modifiers = {words(modifier) for modifier in tolerance.GetModifiers()}
            modifiers.add(words(tolerance.GetMaterialRequirementModifier()))
            is_projected = words(tolerance.GetZoneModifier()) == "projected"
            faces, others = self._items(label)[0]
            yield {
                "place": int(tolerance.GetSemanticName().ToCString()),
                "kind": words(tolerance.GetType()),
                "value": tolerance.GetValue(),
                "zone": words(tolerance.GetTypeOfValue()),
                "projected": tolerance.GetValueOfZoneModifier() if is_projected else None,
                "modifiers": sorted(modifiers - {"", *EXTENTS}),
                "extent": next((extent for extent in EXTENTS if extent in modifiers), ""),
                "datums": datum_system(label),
                "faces": faces,
                "others": others,
            }

    def dimensions(self) -> Iterator[dict[str, Any]]:
        """Yield the dimensions that are more than drawn. A lower deviation has no sign in the kernel."""
        for label, dimension in objects(self.tool.GetDimensionLabels, XCAFDoc_Dimension):
            if dimension.GetType().name.rpartition("_")[2] in PRESENTATIONS:
                continue
            is_range, has_deviations = dimension.IsDimWithRange(), dimension.IsDimWithPlusMinusTolerance()
            (faces, others), (end_faces, end_others) = self._items(label)
            yield {
                "place": int(dimension.GetSemanticName().ToCString()),
                "is_angular": words(dimension.GetType()) == "angular",
                "nominal": None if is_range or dimension.GetValues() is None else dimension.GetValue(),
                "limits": [dimension.GetLowerBound(), dimension.GetUpperBound()] if is_range else None,
                "deviations": [dimension.GetLowerTolValue(), dimension.GetUpperTolValue()] if has_deviations else None,
                "has_fit": dimension.IsDimWithClassOfTolerance(),
                "faces": faces,
                "others": others,
                "end_faces": end_faces,
                "end_others": end_others,
            }

    def _items(self, label: Any) -> list[tuple[list[int], int]]:
        """Return the places of the records of faces, and the number of other shapes, of both sides of an annotation."""
        sides = LabelSequence(), LabelSequence()
        XCAFDoc_DimTolTool.GetRefShapeLabel_s(label, *sides)
        items = []
        for side in sides:
            faces, others = set(), 0
            for piece in side:
                explorer = TopExp_Explorer(XCAFDoc_ShapeTool.GetShape_s(piece).Located(TopLoc_Location()), TopAbs_FACE)
                others += not explorer.More()
                while explorer.More():
                    faces.add(self.places.get(self.transfer.EntityFromShapeResult(explorer.Current(), 1), 0))
                    explorer.Next()
            items.append((sorted(faces - {0}), others))
        return items


def datum_system(label: Any) -> list[list[list[str]]]:
    """Return letters and modifiers in each place of the datum system of a tolerance. A datum has a label for each target."""
    places: dict[int, list[list[str]]] = {}
    for _, datum in objects(lambda labels: XCAFDoc_DimTolTool.GetDatumWithObjectOfTolerLabels_s(label, labels), XCAFDoc_Datum):
        letters, modifiers = places.setdefault(datum.GetPosition(), [[], []])
        letter = "" if datum.GetName() is None else datum.GetName().ToCString()
        letters += [letter] if letter not in letters else []
        modifiers += [modifier for modifier in map(words, datum.GetModifiers()) if modifier not in modifiers]
    return [places[place] for place in sorted(places)]


def objects(fill: Callable[[Any], object], kind: Any) -> Iterator[tuple[Any, Any]]:
    """Yield the labels that `fill` adds to a sequence, with the object of a kind that each has."""
    labels = LabelSequence()
    fill(labels)
    for label in labels:
        attributes = TDF_AttributeIterator(label, True)
        while attributes.More():
            if isinstance(attributes.Value(), kind):
                yield label, attributes.Value().GetObject()
                break
            attributes.Next()


def words(value: Any) -> str:
    """Return a value of an enumeration in words: "GeomToleranceType_CircularRunout" is "circular runout"."""
    name = value.name.removeprefix("XCAFDimTolObjects_").partition("_")[2]
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).replace("_", " ").lower()
    text = text.removeprefix("size ").removeprefix("location ")
    return WORDS.get(text, text)


if __name__ == "__main__":
    limit_resources(int(sys.argv[2]), seconds=int(sys.argv[3]))
    output = os.dup(1)
    os.dup2(2, 1)  # the kernel prints messages
    document = Document(Path(sys.argv[1]))
    annotations = {
        "record_count": len(document.places),
        "tolerances": list(document.tolerances()),
        "dimensions": list(document.dimensions()),
    }
    with os.fdopen(output, "w", encoding="utf-8") as file:
        json.dump(annotations, file)
    os._exit(0)  # compiled libraries may crash when they tidy up after a damaged file
