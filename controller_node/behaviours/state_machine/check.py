"""Whether a state machine fits a character, and always goes on."""

from controller_node.behaviours.state_machine.description import (
    BALANCE,
    REACH,
    STANCE,
    STAND,
    STEP,
    SWING,
    JointTarget,
    Machine,
    State,
)
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError, one_of


def check_machine(machine: Machine, character: Character) -> None:
    """Raise ConfigurationError, with the file, the state and the name, if a machine cannot run."""
    kinds = {joint.name: joint.type for joint in character.moving_joints}
    driven = character.layout.actuated_joint_names
    for side, joints in machine.sides.items():
        for part, joint in joints.items():
            if joint not in driven:
                place = f"{machine.file}: sides.{side}.{part}:"
                raise ConfigurationError(f"{place} {one_of('joint', joint, driven)}")
    names = list(machine.states)
    if machine.start not in names:
        raise ConfigurationError(f"{machine.file}: start: {one_of('state', machine.start, names)}")
    for state in machine.states.values():
        _check_state(machine, state, kinds)
    _check_reached(machine)
    _check_time(machine)


def _check_state(machine: Machine, state: State, kinds: dict[str, JointType]) -> None:
    place = f"{machine.file}: states.{state.name}"
    for end in state.ends:
        if end.then not in machine.states:
            names = list(machine.states)
            raise ConfigurationError(f"{place}.ends: {one_of('state', end.then, names)}")
    for key, joints in (
        ("targets", [target.joint for target in state.targets]),
        ("gains", list(state.gains)),
        ("efforts", list(state.efforts)),
    ):
        for joint in joints:
            _check_joint(machine, f"{place}.{key}", joint, kinds)
    for target in state.targets:
        _check_target(machine, place, target, kinds)
    if state.tracks and STAND in state.feet.values():
        raise ConfigurationError(
            f"{place}: a state that tracks has no foot that stands; its feet must be 'free', "
            f"'{STEP}' or '{REACH}'"
        )
    for joint, effort in state.efforts.items():
        key = f"{place}.efforts.{joint}"
        _check_effort(state, key, joint, effort, _kind(machine, joint, kinds))
    if REACH in state.feet.values() and state.placement.length <= 0.0:
        raise ConfigurationError(
            f"{place}: a foot that reaches needs 'placement.length', m, from hip to sole"
        )


def _check_joint(machine: Machine, place: str, name: str, kinds: dict[str, JointType]) -> None:
    parts = next(iter(machine.sides.values()))
    known = [joint for joint in kinds if kinds[joint] is not JointType.FLOATING]
    known += [f"{role}.{part}" for role in (STANCE, SWING) for part in parts]
    if name not in known:
        raise ConfigurationError(f"{place}: {one_of('joint', name, known)}")


def _kind(machine: Machine, name: str, kinds: dict[str, JointType]) -> JointType:
    """The type of a joint, which both sides share."""
    return kinds[machine.joint(name, next(iter(machine.sides)))]


def _check_target(
    machine: Machine, place: str, target: JointTarget, kinds: dict[str, JointType]
) -> None:
    """A ball joint's target has three numbers, a hinge's one."""
    kind = _kind(machine, target.joint, kinds)
    key = f"{place}.targets.{target.joint}"
    if target.likeness is not None and kind is not JointType.SPHERICAL:
        raise ConfigurationError(f"{key}: what goes with a leg must be a ball joint")
    if kind is JointType.SPHERICAL and target.size == 1:
        raise ConfigurationError(f"{key}: it is {kind.value}, and must have three numbers")
    if kind is not JointType.SPHERICAL and target.size == 3:
        raise ConfigurationError(
            f"{key}: roll, pitch and yaw are for a ball joint; it is {kind.value}, and must have "
            "one number"
        )


def _check_effort(
    state: State, key: str, joint: str, effort: str | tuple[float, ...], kind: JointType
) -> None:
    """A ball joint's effort has three numbers, a hinge's one; a stance hip's may be balanced."""
    if not isinstance(effort, str):
        size = 3 if kind is JointType.SPHERICAL else 1
        if len(effort) != size:
            numbers = "three numbers" if size == 3 else "one number"
            raise ConfigurationError(f"{key}: it is {kind.value}, and must have {numbers}, N m")
        return
    if joint != f"{STANCE}.hip":
        raise ConfigurationError(f"{key} is '{BALANCE}', which is for '{STANCE}.hip' alone")
    if not state.tracks:
        raise ConfigurationError(f"{key} is '{BALANCE}', which goes with 'tracks: true'")


def _check_reached(machine: Machine) -> None:
    """Every state but the included ones must be reached."""
    reached, queue = {machine.start}, [machine.start]
    while queue:
        for end in machine.states[queue.pop()].ends:
            if end.then not in reached:
                reached.add(end.then)
                queue.append(end.then)
    for name in machine.states:
        if name not in reached and "." not in name:
            raise ConfigurationError(f"{machine.file}: states.{name}: no state ends in it")


def _check_time(machine: Machine) -> None:
    """No states may follow each other in a circle that takes no time."""
    timeless = {
        name: [end.then for end in state.ends if not end.takes_time]
        for name, state in machine.states.items()
    }
    for name in timeless:
        circle = _circle(timeless, [name])
        if circle:
            raise ConfigurationError(
                f"{machine.file}: states {' -> '.join(circle)} may follow each other without time; "
                "give one of their ends a condition such as {time: '> 0.1'}"
            )


def _circle(following: dict[str, list[str]], path: list[str]) -> list[str]:
    """The first way from the beginning of a path back to it."""
    seen: set[str] = set()
    queue = [path]
    while queue:
        way = queue.pop()
        for name in following[way[-1]]:
            if name == path[0]:
                return [*way, name]
            if name not in seen:
                seen.add(name)
                queue.append([*way, name])
    return []
