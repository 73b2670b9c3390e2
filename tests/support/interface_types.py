"""Messages of packages that are not among the wheels, from their fields, which are written here.

They stand in for the packages' own: objects with the same fields, defaults and constants. What they
are by the wire is seen in a ROS install alone (.github/workflows/jazzy.yml).
"""

from typing import Any

from rosbags.typesys import get_types_from_msg

from msgs_config.messages import typed

_SIMULATION = {
    "Result": "uint8 result\nstring error_message",
    "SimulationState": "uint8 state",
    "SimulatorFeatures": "uint16[] features\nstring[] spawn_formats\nstring custom_info",
    "EntityCategory": "uint8 category",
    "TagsFilter": "string[] tags\nuint8 filter_mode",
    "Bounds": "uint8 type\ngeometry_msgs/Vector3[] points",
    "EntityFilters": "string filter\nEntityCategory[] categories\nTagsFilter tags\nBounds bounds",
    "EntityState": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n"
        "geometry_msgs/Accel acceleration"
    ),
    "Resource": "string uri\nstring resource_string",
    "WorldResource": "string name\nResource world_resource\nstring description\nstring[] tags",
}
_SERVICES = {  # request, response
    "GetSimulatorFeatures": ("uint8 unused", "SimulatorFeatures features"),
    "ResetSimulation": ("uint8 scope", "Result result"),
    "GetSimulationState": ("uint8 unused", "SimulationState state\nResult result"),
    "SetSimulationState": ("SimulationState state", "Result result"),
    "StepSimulation": ("uint64 steps", "Result result"),
    "GetEntities": ("EntityFilters filters", "Result result\nstring[] entities"),
    "GetEntityState": ("string entity", "Result result\nEntityState state"),
    "SetEntityState": ("string entity\nEntityState state", "Result result"),
    "SetEntityState2": (
        "string entity\nEntityState state\nbool set_pose\nbool set_twist\nbool set_acceleration",
        "Result result",
    ),
    "SpawnEntity": (
        "string name\nbool allow_renaming\nstring uri\nstring resource_string\n"
        "string entity_namespace\ngeometry_msgs/PoseStamped initial_pose",
        "Result result\nstring entity_name",
    ),
    "SpawnEntity2": (
        "string name\nbool allow_renaming\nResource entity_resource\n"
        "string entity_namespace\ngeometry_msgs/PoseStamped initial_pose",
        "Result result\nstring entity_name",
    ),
    "LoadWorld": (
        "string uri\nstring resource_string\nbool fail_on_unsupported_element\n"
        "bool ignore_missing_or_unsupported_assets",
        "Result result\nWorldResource world",
    ),
}
_CONTROL = {
    "JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration",
    "FollowGoal": (
        "trajectory_msgs/JointTrajectory trajectory\n"
        "trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
        "JointTolerance[] path_tolerance\nJointTolerance[] goal_tolerance\n"
        "builtin_interfaces/Duration goal_time_tolerance"
    ),
    "FollowResult": "int32 error_code\nstring error_string",
    "FollowFeedback": (
        "std_msgs/Header header\nstring[] joint_names\n"
        "trajectory_msgs/JointTrajectoryPoint desired\n"
        "trajectory_msgs/JointTrajectoryPoint actual\n"
        "trajectory_msgs/JointTrajectoryPoint error\nint32 index"
    ),
}
_STEPS = {
    "StepsGoal": "uint64 steps",
    "StepsResult": "Result result",
    "StepsFeedback": "uint64 completed_steps\nuint64 remaining_steps",
}


def _register() -> None:
    texts = {f"simulation_interfaces/msg/{name}": text for name, text in _SIMULATION.items()}
    for name, (request, response) in _SERVICES.items():
        texts[f"simulation_interfaces/msg/{name}Request"] = request
        texts[f"simulation_interfaces/msg/{name}Response"] = response
    texts |= {f"simulation_interfaces/msg/{name}": text for name, text in _STEPS.items()}
    texts |= {f"control_msgs/msg/{name}": text for name, text in _CONTROL.items()}
    found: dict[str, Any] = {}
    for name, text in texts.items():
        found |= get_types_from_msg(text, name)
    known = typed.types().fielddefs
    typed.types().register({name: each for name, each in found.items() if name not in known})


def message(name: str, /, **fields: Any) -> Any:
    """A message of `simulation_interfaces`, as `GetEntitiesRequest`, with these fields."""
    _register()
    return typed.new(f"simulation_interfaces/msg/{name}", **fields)


def control_message(name: str, /, **fields: Any) -> Any:
    """A message of `control_msgs`; those of its action are `FollowGoal`, ..."""
    _register()
    return typed.new(f"control_msgs/msg/{name}", **fields)


class PlayedGoal:
    """A goal of an action, as a bus hands it over."""

    def __init__(self, request: Any, result: Any, feedback: Any) -> None:
        self.request, self.result = request, result
        self.is_cancelled = False
        self.told: list[Any] = []
        self._feedback = feedback

    @property
    def feedback(self) -> Any:
        return self._feedback()

    def publish(self, feedback: Any) -> None:
        self.told.append(feedback)
