"""Makers of motion capture, by the conventions that their files follow."""

from collections.abc import Mapping

from tests.support.captures import SIDES, Y_UP, Z_UP, Maker, Proportions


def names_of(
    sides: tuple[str, str], pattern: Mapping[str, str], trunk: Mapping[str, str]
) -> dict[str, str]:
    """Names by part, of both sides, where `*` stands for a side's word."""
    names = dict(trunk)
    for side, word in zip(SIDES, sides, strict=True):
        names |= {f"{side}_{part}": name.replace("*", word) for part, name in pattern.items()}
    return names


_HIK = {
    "hip": "*UpLeg", "knee": "*Leg", "ankle": "*Foot", "toe": "*ToeBase",
    "collar": "*Shoulder", "shoulder": "*Arm", "elbow": "*ForeArm", "wrist": "*Hand",
}  # fmt: skip
_TRUNK = {"hips": "Hips", "neck": "Neck", "head": "Head"}
_WORDS = ("Left", "Right")
_CLASSIC = {
    "hip": "*Hip", "knee": "*Knee", "ankle": "*Ankle", "toe": "*Toe",
    "collar": "*Collar", "shoulder": "*Shoulder", "elbow": "*Elbow", "wrist": "*Wrist",
}  # fmt: skip
_BIPED = {
    "hip": "Bip01 * Thigh", "knee": "Bip01 * Calf", "ankle": "Bip01 * Foot",
    "toe": "Bip01 * Toe0", "collar": "Bip01 * Clavicle", "shoulder": "Bip01 * UpperArm",
    "elbow": "Bip01 * Forearm", "wrist": "Bip01 * Hand",
}  # fmt: skip
_COURSE = {
    "hip": "*Hip", "knee": "*Knee", "ankle": "*Ankle", "toe": "*ToeJoint",
    "collar": "*Torso_Clavicle", "shoulder": "*Shoulder", "elbow": "*Elbow", "wrist": "*Wrist",
}  # fmt: skip
_BANDAI = {
    "hip": "UpperLeg_*", "knee": "LowerLeg_*", "ankle": "Foot_*", "toe": "Toes_*",
    "collar": "Shoulder_*", "shoulder": "UpperArm_*", "elbow": "LowerArm_*", "wrist": "Hand_*",
}  # fmt: skip
_SMPL = {
    "hip": "*_Hip", "knee": "*_Knee", "ankle": "*_Ankle", "toe": "*_Foot",
    "collar": "*_Collar", "shoulder": "*_Shoulder", "elbow": "*_Elbow", "wrist": "*_Wrist",
}  # fmt: skip
_ROKOKO = {
    "hip": "*Thigh", "knee": "*Shin", "ankle": "*Foot", "toe": "*Toe",
    "collar": "*Shoulder", "shoulder": "*Arm", "elbow": "*ForeArm", "wrist": "*Hand",
}  # fmt: skip
_DAZ = {
    "hip": "*Thigh", "knee": "*Shin", "ankle": "*Foot",
    "collar": "*Collar", "shoulder": "*Shldr", "elbow": "*ForeArm", "wrist": "*Hand",
}  # fmt: skip

MAKERS: dict[str, Maker] = {
    "cmu": Maker(
        names_of(_WORDS, _HIK, _TRUNK), spine=("LowerBack", "Spine", "Spine1"), order="ZYX",
        unit=0.056444, legs=0.35, hip_joints="{L}HipJoint", first_rest=True, fingers=True,
        rate=120.0, indent="\t",
    ),
    "mixamo": Maker(
        {part: f"mixamorig:{name}" for part, name in names_of(_WORDS, _HIK, _TRUNK).items()},
        spine=("mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"), order="ZXY",
        fingers=True, positions=True, yaw=2.2, line_end="\r\n",
        proportions=Proportions(thigh=0.44, shank=0.43, spine=0.5, upper_arm=0.26, forearm=0.27),
    ),
    "lafan": Maker(
        names_of(_WORDS, {**_HIK, "toe": "*Toe"}, _TRUNK), spine=("Spine", "Spine1", "Spine2"),
        order="ZYX", bent_frames=True, yaw=-1.1, rate=30.0,
    ),
    "biovision": Maker(
        names_of(_WORDS, {k: v for k, v in _CLASSIC.items() if k != "toe"}, _TRUNK),
        spine=("Chest",), order="ZXY", unit=0.0254, rate=30.0,
        proportions=Proportions(thigh=0.40, shank=0.44, hip_width=0.08, hip_drop=0.0),
    ),
    "biped": Maker(
        names_of(("L", "R"), _BIPED, {"hips": "Bip01", "neck": "Bip01 Neck", "head": "Bip01 Head"}),
        spine=("Bip01 Spine", "Bip01 Spine1"), order="ZYX", unit=0.0254, world=Z_UP, rest=Z_UP,
        yaw=0.8, indent="\t",
    ),
    "bandai": Maker(
        names_of(("L", "R"), _BANDAI, _TRUNK), spine=("Spine", "Chest"), order="ZYX",
        above_root="joint_Root", positions=True, arms=0.0,
        proportions=Proportions(thigh=0.38, shank=0.37, ankle=0.07, spine=0.42),
    ),
    "rokoko": Maker(
        names_of(_WORDS, _ROKOKO, _TRUNK), spine=("Spine1", "Spine2", "Spine3", "Spine4"),
        order="YXZ", unit=1.0, number="{:.8e}", rate=100.0, arms=0.7,
    ),
    "smpl": Maker(
        names_of(("L", "R"), _SMPL, {"hips": "Pelvis", "neck": "Neck", "head": "Head"}),
        spine=("Spine1", "Spine2", "Spine3"), order="XYZ", unit=1.0, world=Z_UP, rest=Y_UP,
        yaw=3.0, rate=60.0,
    ),
    "course": Maker(
        names_of(("l", "r"), _COURSE, {"hips": "RootJoint", "neck": "torso_head"}),
        spine=("pelvis_lowerback", "lowerback_torso"), order="XYZ", unit=1.0, rate=60.0,
        proportions=Proportions(thigh=0.39, shank=0.40, shoulder_width=0.2),
    ),
    "daz": Maker(
        names_of(("l", "r"), _DAZ, {"hips": "hip", "neck": "neck", "head": "head"}),
        spine=("abdomen", "chest"), order="ZXY", unit=0.01, arms=0.0, first_rest=True, rate=120.0,
        line_end="\r\n",
    ),
    "in place": Maker(
        names_of(_WORDS, _CLASSIC, _TRUNK), spine=("Chest", "Chest2", "Chest3", "Chest4"),
        order="YXZ", root_moves=False, rate=60.0,
    ),
}  # fmt: skip
"""Makers by the convention that they follow."""

TEN_FILES = [
    ("cmu", "walk"),
    ("mixamo", "run"),
    ("lafan", "dance_a"),
    ("biovision", "dance_b"),
    ("biped", "kick"),
    ("bandai", "punch"),
    ("rokoko", "jump"),
    ("smpl", "spin"),
    ("course", "crawl"),
    ("daz", "cartwheel"),
]
"""A file of each maker, by the clip that it shows."""
