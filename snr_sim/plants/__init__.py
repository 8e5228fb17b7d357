"""Simulated physics behind the devices. Plants implement `Plant` of `prelude/plant.py` and know only that interface."""

from typing import TYPE_CHECKING

from snr_sim.lazy import lazy_names

if TYPE_CHECKING:
    from snr_sim.plants.battery import Battery as Battery
    from snr_sim.plants.battery import BenchSupply as BenchSupply
    from snr_sim.plants.ground.diff_drive_2d import DiffDrive2D as DiffDrive2D
    from snr_sim.plants.ground.dozer import Dozer as Dozer
    from snr_sim.plants.ground.dozer import Heap as Heap
    from snr_sim.plants.ground.dozer_2d import Dozer2D as Dozer2D
    from snr_sim.plants.ground.explorer import DriveStart as DriveStart
    from snr_sim.plants.ground.explorer import Explorer as Explorer
    from snr_sim.plants.ground.height_map import HeightMap as HeightMap
    from snr_sim.plants.ground.height_map import make_hills as make_hills
    from snr_sim.plants.ground.manipulator import Manipulator as Manipulator
    from snr_sim.plants.ground.motor_faults import MotorFault as MotorFault
    from snr_sim.plants.ground.planar_vehicles import dozer_rover as dozer_rover
    from snr_sim.plants.ground.planar_vehicles import explorer_rover as explorer_rover
    from snr_sim.plants.ground.rocks import Ledge as Ledge
    from snr_sim.plants.ground.rocks import Rock as Rock
    from snr_sim.plants.ground.room import Room as Room
    from snr_sim.plants.ground.room import Walker as Walker
    from snr_sim.plants.ground.room_space import WALL_RADIUS_M as WALL_RADIUS_M
    from snr_sim.plants.ground.rover import Rover as Rover
    from snr_sim.plants.ground.rover import RoverStart as RoverStart
    from snr_sim.plants.ground.rover_2d import Rover2D as Rover2D
    from snr_sim.plants.ground.rover_file import read_rover as read_rover
    from snr_sim.plants.ground.rover_vehicle import RoverVehicle as RoverVehicle
    from snr_sim.plants.ground.terramechanics import DRY_SAND as DRY_SAND
    from snr_sim.plants.ground.terramechanics import LUNAR_SOIL as LUNAR_SOIL
    from snr_sim.plants.ground.terramechanics import Bekker as Bekker
    from snr_sim.plants.ground.terramechanics import Coulomb as Coulomb
    from snr_sim.plants.ground.terramechanics import Ground as Ground
    from snr_sim.plants.lander.descent import MOON_GRAVITY_MPS2 as MOON_GRAVITY_MPS2
    from snr_sim.plants.lander.descent import STANDARD_GRAVITY_MPS2 as STANDARD_GRAVITY_MPS2
    from snr_sim.plants.lander.descent import Engine as Engine
    from snr_sim.plants.lander.descent import Motion as Motion
    from snr_sim.plants.lander.descent import constant_mass_ignition_m as constant_mass_ignition_m
    from snr_sim.plants.lander.descent import free_fall as free_fall
    from snr_sim.plants.lander.descent import minimum_fuel_descent as minimum_fuel_descent
    from snr_sim.plants.lander.descent import propagate as propagate
    from snr_sim.plants.lander.descent import stop_height as stop_height
    from snr_sim.plants.lander.gear import APOLLO_GEAR as APOLLO_GEAR
    from snr_sim.plants.lander.gear import GearLimits as GearLimits
    from snr_sim.plants.lander.gear import Touchdown as Touchdown
    from snr_sim.plants.lander.lander import Lander as Lander
    from snr_sim.plants.lander.lander_1d import Lander1D as Lander1D
    from snr_sim.plants.lander.lander_1d import VerticalStart as VerticalStart
    from snr_sim.plants.lander.lander_2d import Lander2D as Lander2D
    from snr_sim.plants.lander.lander_3d import Lander3D as Lander3D
    from snr_sim.plants.lander.module import Leg as Leg
    from snr_sim.plants.lander.module import LunarModule as LunarModule
    from snr_sim.plants.lander.module import PlaneStart as PlaneStart
    from snr_sim.plants.lander.module import Throttle as Throttle
    from snr_sim.plants.lander.terrain import Terrain as Terrain
    from snr_sim.plants.lander.terrain import make_terrain as make_terrain
    from snr_sim.plants.parameter_limits import DEGREES as DEGREES
    from snr_sim.plants.parameter_limits import IS_ABOVE as IS_ABOVE
    from snr_sim.plants.parameter_limits import Limit as Limit
    from snr_sim.plants.parameter_limits import check_number as check_number
    from snr_sim.plants.parameter_limits import check_record as check_record
    from snr_sim.plants.parameter_limits import check_vector as check_vector
    from snr_sim.plants.parameter_limits import format_value as format_value
    from snr_sim.plants.stepping import RealTimePlant as RealTimePlant
    from snr_sim.plants.urov.dive import Current as Current
    from snr_sim.plants.urov.dive import Dive as Dive
    from snr_sim.plants.urov.dive import Leak as Leak
    from snr_sim.plants.urov.dive import Payload as Payload
    from snr_sim.plants.urov.dive import ThrusterFault as ThrusterFault
    from snr_sim.plants.urov.pool import Gate as Gate
    from snr_sim.plants.urov.pool import Pool as Pool
    from snr_sim.plants.urov.propulsion import Propulsion as Propulsion
    from snr_sim.plants.urov.tether import Tether as Tether
    from snr_sim.plants.urov.urov import Urov as Urov
    from snr_sim.plants.urov.urov_2d import Urov2D as Urov2D
    from snr_sim.plants.urov.urov_state import WrenchCommand as WrenchCommand
    from snr_sim.plants.urov.vehicle import Thruster as Thruster
    from snr_sim.plants.urov.vehicle import Vehicle as Vehicle
    from snr_sim.plants.urov.vehicle_file import read_vehicle as read_vehicle
    from snr_sim.prelude.plant import Plant as Plant
else:
    __all__, __getattr__, __dir__ = lazy_names(__name__)
