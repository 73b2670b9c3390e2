"""The numbers of `simulation_interfaces` 1.5 and 2.1, which agree on them. No ROS in here."""

from enum import IntEnum, IntFlag

from msgs_config.errors import ActuatedCharactersError

PACKAGE = "simulation_interfaces"
SERVICE_CODES = 100  # above them are a service's own


class Code(IntEnum):
    """Results of all services."""

    FEATURE_UNSUPPORTED = 0
    OK = 1
    NOT_FOUND = 2
    INCORRECT_STATE = 3
    OPERATION_FAILED = 4


class StateCode(IntEnum):
    """More results of SetSimulationState."""

    ALREADY_IN_TARGET_STATE = 101
    STATE_TRANSITION_ERROR = 102
    INCORRECT_TRANSITION = 103


class SpawnCode(IntEnum):
    """More results of SpawnEntity."""

    NAME_NOT_UNIQUE = 101
    NAME_INVALID = 102
    UNSUPPORTED_FORMAT = 103
    NO_RESOURCE = 104
    NAMESPACE_INVALID = 105
    RESOURCE_PARSE_ERROR = 106
    INVALID_POSE = 109


class WorldCode(IntEnum):
    """More results of LoadWorld."""

    UNSUPPORTED_FORMAT = 101
    NO_RESOURCE = 102


INVALID_ENTITY_POSE = 101
"""Another result of SetEntityState."""


class State(IntEnum):
    """States of a simulation."""

    STOPPED = 0
    PLAYING = 1
    PAUSED = 2
    QUITTING = 3
    NO_WORLD = 4
    LOADING_WORLD = 5


class Scope(IntFlag):
    """What a reset resets."""

    DEFAULT = 0
    TIME = 1
    STATE = 2
    SPAWNED = 4
    ALL = 255


class Category(IntEnum):
    """What an entity is."""

    ROBOT = 1
    DYNAMIC_OBJECT = 4


class Feature(IntEnum):
    """What a simulator can do; those that this one can."""

    SPAWNING = 0
    ENTITY_CATEGORIES = 8
    SPAWNING_RESOURCE_STRING = 9
    ENTITY_STATE_GETTING = 10
    ENTITY_STATE_SETTING = 11
    SIMULATION_RESET = 20
    SIMULATION_RESET_STATE = 22
    SIMULATION_RESET_SPAWNED = 23
    SIMULATION_STATE_GETTING = 24
    SIMULATION_STATE_SETTING = 25
    SIMULATION_STATE_PAUSE = 26
    STEP_SIMULATION_SINGLE = 31
    STEP_SIMULATION_MULTIPLE = 32
    STEP_SIMULATION_ACTION = 33


class RefusedRequestError(ActuatedCharactersError):
    """A request is refused, with a code and a sentence."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = int(code)
