"""Colours of what is drawn beside a character's own."""

Color = tuple[int, int, int]

GHOST: Color = (64, 190, 110)
"""Of the reference, or of another run beside it."""

STRAIN: Color = (215, 25, 20)
"""Of a link whose joint is at its limit."""

RIGHT_SIDE: Color = (90, 104, 124)
"""As dark as the right side of a body is in the legend; each body has its own."""

CONTACT: Color = (70, 72, 80)
PUSH: Color = (230, 60, 20)
CENTRE: Color = (250, 200, 0)
SUPPORT: Color = (40, 110, 200)
