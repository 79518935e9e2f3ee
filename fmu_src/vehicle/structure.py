"""Which inputs, start values and parameters the car's outputs depend on: of (3.1)–(3.7), with what cancels left out."""

from __future__ import annotations

from ..quantities import CORNERS

FRONT, REAR = CORNERS[:2], CORNERS[2:]
Names = tuple[str, ...]


def _at(corners: Names, *kinds: str) -> Names:
    return tuple(f"{kind}_{corner}" for kind in kinds for corner in corners)


def _moving(*positions: str) -> Names:
    """The positions and their rates."""
    return positions + tuple(f"der({name})" for name in positions)


# within a step: the struts stand between the body and the road
FEED_THROUGH: dict[str, Names] = {
    **{f"body.{motion}_acceleration": _at(CORNERS, "force") for motion in ("heave", "roll", "pitch")},
    **{f"wheel_{corner}.heave_acceleration": _at((corner,), "force", "h", "dh") for corner in FRONT},
    **{f"axle_r.{motion}_acceleration": _at(REAR, "force", "h", "dh") for motion in ("heave", "roll")},
    **{f"tyre_{corner}.force": _at((corner,), "h", "dh") for corner in CORNERS},
}

# at the start also on start values and parameters
_HEAVE, _ROLL, _PITCH = "body.heave", "body.roll", "body.pitch"
_WHEELS = tuple(f"wheel_{corner}.heave" for corner in FRONT)
_AXLE, _AXLE_ROLL = "axle_r.heave", "axle_r.roll"
_FRONT_STRUTS, _REAR_STRUTS = ("c1", "b1"), ("c2", "b2")
_REAR_MASSES = ("m21", "m22")
INITIALLY: dict[str, Names] = {
    # sums over an axle's two struts know no roll, differences neither heave nor the axle's distance
    "body.heave_acceleration": (
        *_moving(_HEAVE, _PITCH, *_WHEELS, _AXLE),
        *("m", "a", "b", *_FRONT_STRUTS, *_REAR_STRUTS),
    ),
    "body.roll_acceleration": (
        *_moving(_ROLL, _PITCH, *_WHEELS, _AXLE_ROLL),
        *("Jx", "Jy", "Jz", "s0", "s1", *_FRONT_STRUTS, *_REAR_STRUTS),
    ),
    "body.pitch_acceleration": (
        *_moving(_HEAVE, _ROLL, _PITCH, *_WHEELS, _AXLE, _AXLE_ROLL),
        *("Jy", "Jz", "a", "b", "s0", "s1", *_FRONT_STRUTS, *_REAR_STRUTS),
    ),
    **{
        f"{wheel}_acceleration": (
            *_moving(_HEAVE, _ROLL, _PITCH, wheel),
            *(mass, "a", "s1", "cp1", "bp1", *_FRONT_STRUTS),
        )
        for wheel, mass in zip(_WHEELS, ("m11", "m12"), strict=True)
    },
    "axle_r.heave_acceleration": (
        *_moving(_HEAVE, _PITCH, _AXLE),
        *(*_REAR_MASSES, "m2", "b", "cp2", "bp2", *_REAR_STRUTS),
    ),
    "axle_r.roll_acceleration": (
        *_moving(_ROLL, _PITCH, _AXLE_ROLL),
        *(*_REAR_MASSES, "J2", "s0", "s2", "cp2", "bp2", *_REAR_STRUTS),
    ),
    **{
        f"strut_{corner}.travel": (_HEAVE, _ROLL, _PITCH, wheel, "a", "s1")
        for corner, wheel in zip(FRONT, _WHEELS, strict=True)
    },
    **{f"strut_{corner}.travel": (_HEAVE, _ROLL, _PITCH, _AXLE, _AXLE_ROLL, "b", "s0") for corner in REAR},
    **{f"tyre_{corner}.force": (*_moving(wheel), "cp1", "bp1") for corner, wheel in zip(FRONT, _WHEELS, strict=True)},
    **{f"tyre_{corner}.force": (*_moving(_AXLE, _AXLE_ROLL), "s2", "cp2", "bp2") for corner in REAR},
}
