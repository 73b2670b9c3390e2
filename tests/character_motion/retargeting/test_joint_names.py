"""Names of joints as makers of motion capture write them."""

import pytest

from character_motion.retargeting.joint_names import side_and_part


@pytest.mark.parametrize(
    ("name", "side", "part"),
    [
        ("LeftUpLeg", "left", "upleg"),
        ("mixamorig:RightForeArm", "right", "forearm"),
        ("mixamorig1_LeftUpLeg", "left", "upleg"),
        ("Bip01 L Thigh", "left", "thigh"),
        ("Bip01 R Toe0", "right", "toe"),
        ("LHipJoint", "left", "hipjoint"),
        ("lhipjoint", "left", "hipjoint"),
        ("lfemur", "left", "femur"),
        ("LUArm", "left", "uarm"),
        ("RFArm", "right", "farm"),
        ("UpperLeg_L", "left", "upperleg"),
        ("upperleg01.R", "right", "upperleg"),
        ("lTorso_Clavicle", "left", "torsoclavicle"),
        ("rToeJoint", "right", "toejoint"),
        ("DEF-upper_arm.L", "left", "upperarm"),
        ("KneeLeft", "left", "knee"),
        ("LEFTKNEE", "left", "knee"),
        ("lShldrBend", "left", "shldr"),
        ("l_upleg_JNT", "left", "upleg"),
        ("jointLeftHip", "left", "hip"),
        ("Character1_LeftArm", "left", "arm"),
        ("Hips", "", "hips"),
        ("Neck1", "", "neck"),
        ("LeftHandIndex1", "", ""),
        ("LeftForeArmRoll", "", ""),
        ("ball", "", "ball"),
    ],
)
def test_a_name_says_side_and_part(name: str, side: str, part: str) -> None:
    assert side_and_part(name) == (side, part)
