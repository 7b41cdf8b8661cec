from .bodies import assembly, field
from .charts import histogram

__all__ = ["assembly", "field", "histogram"]
