"""What the training may see of the simulator, and what is kept back for the test."""

from dotmask.segmentation.yolact.design import COMPACT
from scenarios.spec import Scenario
from scenarios.world import ROOMS
from sim.people.characters import CHARACTERS
from sim.things.boxes import BOX_LOOKS
from sim.things.chairs import CHAIR_LOOKS
from sim.things.vessels import BOTTLE_LOOKS, CUP_LOOKS

CLASSES = COMPACT.class_names

HELD_OUT_CHARACTERS = ("man", "woman")
"""With all their outfits: those who walk through fr3_walking_* and sit in fr3_sitting_*."""
TRAINING_CHARACTERS = tuple(name for name in CHARACTERS if name not in HELD_OUT_CHARACTERS)

HELD_OUT_CHAIR_COLOURS = ("blue", "black")
"""Those of the chairs of fr3_walking_* and fr3_sitting_*."""
HELD_OUT_CHAIRS = tuple(name for name, look in CHAIR_LOOKS.items() if look.colour in HELD_OUT_CHAIR_COLOURS)
TRAINING_CHAIRS = tuple(name for name in CHAIR_LOOKS if name not in HELD_OUT_CHAIRS)

HELD_OUT_ROOMS = tuple(ROOMS)
"""All rooms of the scenarios; the training has random rooms of its own, see `tools.train_vocabulary.rooms`."""

SHARED_LOOKS = {"cup": CUP_LOOKS, "bottle": BOTTLE_LOOKS, "box": BOX_LOOKS}
"""These the training sees in all their looks, with other seeds: they come in few."""

FIRST_HELD_OUT_SEED = 7_000_000
"""Seeds of the scenarios of the test begin here; scenes of the training have seeds below."""


def seen_in_training(scenario: Scenario) -> tuple[str, ...]:
    """What of a scenario the training had as well: characters in an outfit, and looks of chairs; sorted."""
    people = {f"{p.character} in {p.outfit}" for p in scenario.people.cast if p.character in TRAINING_CHARACTERS}
    chairs = {f"chair {t.look}" for t in scenario.things if t.kind == "chair" and t.look in TRAINING_CHAIRS}
    return tuple(sorted(people | chairs))
