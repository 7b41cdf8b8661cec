"""Names and units of all variables in archives, summaries and comparisons, each defined once."""

from tolcontact.vocabulary.analyses import *  # noqa: F403
from tolcontact.vocabulary.archive import *  # noqa: F403 (one namespace in several files)
from tolcontact.vocabulary.elastic import *  # noqa: F403
from tolcontact.vocabulary.labels import *  # noqa: F403
from tolcontact.vocabulary.labels import ArchiveVariable as ArchiveVariable
from tolcontact.vocabulary.summary import *  # noqa: F403
from tolcontact.vocabulary.variation import *  # noqa: F403
