"""Where methods fail: maps of it, a catalogue of known ways, and random scenes that try to find unknown ones."""

from validation.studies.stability.atlas import atlas
from validation.studies.stability.catalogue import CATALOGUE
from validation.studies.stability.hostile import hostile_survey

__all__ = ["CATALOGUE", "atlas", "hostile_survey"]
