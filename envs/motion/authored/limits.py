"""The published box of each ball joint: degrees of its exponential map about x, y and z (ASE's character)."""

BALL_LIMITS: dict[str, tuple[tuple[float, float], ...]] = {
    "abdomen": ((-60, 60), (-60, 90), (-50, 50)),
    "neck": ((-50, 50), (-40, 60), (-45, 45)),
    "right_shoulder": ((-180, 45), (-180, 60), (-90, 90)),
    "right_wrist": ((-90, 90), (-90, 90), (-90, 90)),
    "left_shoulder": ((-45, 180), (-180, 60), (-90, 90)),
    "right_hip": ((-60, 15), (-140, 60), (-60, 35)),
    "right_ankle": ((-30, 30), (-55, 55), (-40, 40)),
    "left_hip": ((-15, 60), (-140, 60), (-35, 60)),
    "left_ankle": ((-30, 30), (-55, 55), (-40, 40)),
}
KNEE_SLACK = 0.10  # the knees never straighten beyond this [rad]
