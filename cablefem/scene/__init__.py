"""WHAT is simulated: a cable, its supports and the mass that travels along it."""

from cablefem.scene.cable import Cable, Supports
from cablefem.scene.catenary import Catenary
from cablefem.scene.drive import Drive, Driving
from cablefem.scene.errors import SceneError
from cablefem.scene.motion import Motion, Piece
from cablefem.scene.ride import LoadPath, Ride
from cablefem.scene.scene import Groups, Mass, Scene
from cablefem.scene.statics import NoRest, Rest
from cablefem.scene.surroundings import Obstacle
from cablefem.scene.travel import AccelerateCruiseBrake, ConstantAcceleration, ConstantSpeed, Table, Trapezoid, Travel
