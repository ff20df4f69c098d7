"""WHAT is simulated: a cable, its supports and the mass that travels along it."""

from cablefem.scene.cable import Cable, Supports
from cablefem.scene.catenary import Catenary
from cablefem.scene.errors import SceneError
from cablefem.scene.motion import Motion, Piece
from cablefem.scene.scene import Groups, Mass, Scene
from cablefem.scene.travel import (
    AccelerateCruiseBrake,
    ConstantAcceleration,
    ConstantSpeed,
    Table,
    Travel,
)

__all__ = [
    "AccelerateCruiseBrake",
    "Cable",
    "Catenary",
    "ConstantAcceleration",
    "ConstantSpeed",
    "Groups",
    "Mass",
    "Motion",
    "Piece",
    "Scene",
    "SceneError",
    "Supports",
    "Table",
    "Travel",
]
