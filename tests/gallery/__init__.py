"""What the gallery shows: each kind of widget in each of its states, with attributes made by hand."""

from typing import Final

from tests.gallery.controls import (
    ACTIONS,
    ALARMS,
    INPUTS,
    JOYSTICKS,
    KEYS,
    PARAMETERS,
    ROLES,
    STATIC,
    STEPS,
    SWITCHES,
)
from tests.gallery.displays import (
    CAMERAS,
    CHECKS,
    FIGURES,
    GAUGES,
    JOINT_ROWS,
    LAMPS,
    LOGS,
    MAPS,
    PALLETS,
    PLACES,
    READOUTS,
    SEQUENCES,
    TABLES,
    TOURS,
    TRENDS,
)
from tests.gallery.examples import Part

PARTS: Final = (
    Part("Keys by role", 6, ROLES),
    Part("Keys by state", 6, KEYS),
    Part("Actions", 3, ACTIONS),
    Part("Readouts", 6, READOUTS),
    Part("Lamps", 6, LAMPS),
    Part("Figures", 3, FIGURES),
    Part("Pallets", 6, PALLETS),
    Part("Conditions", 3, CHECKS),
    Part("Alarms", 2, ALARMS),
    Part("Sequences", 3, SEQUENCES),
    Part("Gauges", 6, GAUGES),
    Part("Joints", 3, JOINT_ROWS),
    Part("Tables", 2, TABLES),
    Part("Inputs", 3, INPUTS),
    Part("Parameters", 3, PARAMETERS),
    Part("Steps", 3, STEPS),
    Part("Switches", 3, SWITCHES),
    Part("Joysticks", 4, JOYSTICKS),
    Part("Cameras", 3, CAMERAS),
    Part("Maps", 2, MAPS),
    Part("Places", 2, PLACES),
    Part("Tours", 3, TOURS),
    Part("Logs", 2, LOGS),
    Part("Trends", 2, TRENDS),
    Part("Static", 5, STATIC),
)
PICTURE: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 24"><path fill="#b9a17c" stroke="#333" '
    'd="M2 2h36v20H2z"/></svg>'
)
