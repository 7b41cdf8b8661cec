"""Rebuild the model of an archive: model_of.py ARCHIVE."""

import sys

import tolcontact as tc

tc.io.model_of(tc.open_archive(sys.argv[1]))
