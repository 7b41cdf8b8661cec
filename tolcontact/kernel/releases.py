"""Names that differ between the releases 7.9 and 8.0 of OCP: CadQuery 2.8 installs the former."""

from OCP.TopoDS import TopoDS

try:
    from OCP.collections import Sequence_TDF_Label as LabelSequence
except ModuleNotFoundError:  # 7.9
    from OCP.TDF import TDF_LabelSequence as LabelSequence

as_face = getattr(TopoDS, "Face_s", TopoDS.Face)  # a shape as the face that it is

__all__ = ["LabelSequence", "as_face"]
