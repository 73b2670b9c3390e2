"""Where the reference's world goes next: `Anchor.advanced` in plain numbers."""

import math

PERTURBED_AT = 0.28  # m from the reference's centre of mass at which it is perturbed
FAST = 0.8  # m/s off the reference at which it is perturbed; an unpushed walk reaches 0.63
SOON = 0.1  # s, how much later the reference is looked at, too: nobody follows a jump of its speed
PERTURBED_SECONDS = 1.0  # s that it stays perturbed, and that the reference counts as just stopped
FOLLOWS_IN = 0.3  # s, time constant with which the place gives way
TURNS_IN = 1.0  # s, time constant with which the heading gives way
RETURNS_IN = 3.0  # s, time constant of place and heading on the way back
TRAVELS = 0.02  # m/s of the reference's centre of mass from which on it goes somewhere
TURNS = 0.02  # rad/s of the reference's root about z from which on it goes somewhere
RETURN_SPEED = 0.15  # m/s, at most, of the place on the way back


def advance_anchor(
    place: complex,
    yaw: float,
    calm_from: float,
    settled_from: float,
    centre: complex,
    velocity: complex,
    off_heading: float,
    wanted: complex,
    wanted_velocity: complex,
    velocity_soon: complex,
    wanted_turn: float,
    time: float,
    elapsed: float,
) -> tuple[complex, float, float, float]:
    """The first four arguments, those of an `Anchor`, after a look at a state and the reference.

    Not perturbed is who is about as fast as the reference, or as it will be soon: captured motion
    has frames of another speed.
    """
    error, slip, before = centre - wanted, velocity - wanted_velocity, velocity - velocity_soon
    far = math.sqrt(error.real * error.real + error.imag * error.imag) > PERTURBED_AT
    is_fast = math.sqrt(slip.real * slip.real + slip.imag * slip.imag) > FAST
    is_fast &= math.sqrt(before.real * before.real + before.imag * before.imag) > FAST
    if far or is_fast:
        calm_from = time + PERTURBED_SECONDS
    speed = math.sqrt(
        wanted_velocity.real * wanted_velocity.real + wanted_velocity.imag * wanted_velocity.imag
    )
    travels = speed > TRAVELS or abs(wanted_turn) > TURNS
    if travels:
        settled_from = time + PERTURBED_SECONDS
    if time < calm_from or (not travels and time < settled_from):
        turned = yaw + min(elapsed / TURNS_IN, 1.0) * off_heading
        there = complex(math.cos(yaw), math.sin(yaw)) * centre + place
        share = min(elapsed / FOLLOWS_IN, 1.0)
        to = complex(math.cos(turned), math.sin(turned))
        place, yaw = there - to * (centre - share * (centre - wanted)), turned
    if travels:
        away = complex(math.cos(yaw), math.sin(yaw)) * wanted + place - wanted
        share = min(elapsed / RETURNS_IN, 1.0)
        yaw = (1.0 - share) * yaw
        length = math.sqrt(away.real * away.real + away.imag * away.imag)
        if share * length > RETURN_SPEED * elapsed:
            share = RETURN_SPEED * elapsed / length
        place = wanted + (1.0 - share) * away - complex(math.cos(yaw), math.sin(yaw)) * wanted
    return place, yaw, calm_from, settled_from
