"""One row for each kind of lobe: its parameters, and what its light counts as.

`engine.scene` checks lobes by it, `engine.native` packs them by it, and
`packaging/closures_table.py` writes it for the core and into docs/semantics/lobes.md, which says
what each kind gives back.
"""

from __future__ import annotations

from dataclasses import dataclass

LEAST_IOR, LARGEST = 1e-30, 1e30
"""Of indices of refraction, of exponents too: squares, and one over them, stay finite."""


@dataclass(frozen=True)
class Parameter:
    """A number of a lobe, from `low` to `high`.

    name: the field of `engine.scene.Lobe`; with `varies` one of the material's program may take its
    place, kept from 0 to the lobe's own. place: which of the core's three numbers has it.
    """

    name: str
    place: int
    low: float
    high: float
    varies: bool = True


EXPONENT = Parameter("exponent", 0, 0.0, LARGEST)
MASKING = Parameter("masking", 1, 0.0, 1.0)
IOR = Parameter("ior", 2, LEAST_IOR, LARGEST)
TOON = (Parameter("size", 0, 0.0, 1.0), Parameter("smooth", 1, 0.0, 1.0))
FIBRE = (EXPONENT, Parameter("fan", 1, 0.0, 1.0), Parameter("tilt", 2, -1.0, 1.0, varies=False))


@dataclass(frozen=True)
class Closure:
    """A kind of lobe.

    counts: as which light what it gives back does: AMBIENT, MATT, GLOSSY, TRANSMISSION, EMISSION or
    NOTHING.  normal: whose it has, the POINT's, or its OWN where the program gives it one; "" where
    none matters.  columns: of a row of the core's that says what it gives back of light from a
    direction, k among them, the fewest; 0 where k is enough.  passes: rays go on from it.
    by_view: it is times (1 - n·v) to its exponent.  of_fibre: light goes round a strand.
    """

    name: str
    counts: str
    parameters: tuple[Parameter, ...] = ()
    normal: str = ""
    columns: int = 0
    passes: bool = False
    by_view: bool = False
    of_fibre: bool = False


CLOSURES = {
    row.name: row
    for row in (
        Closure("AMBIENT", "AMBIENT", (EXPONENT,), by_view=True),
        Closure("DIFFUSE", "MATT", (EXPONENT,), "POINT", by_view=True),
        Closure("SPECULAR", "GLOSSY", (EXPONENT, MASKING, IOR), "OWN", 4),
        Closure("MIRROR", "GLOSSY", (IOR,), "OWN", 4, passes=True),
        Closure("REFRACTION", "TRANSMISSION", (EXPONENT, IOR), "OWN", passes=True),
        Closure("TRANSPARENT", "TRANSMISSION", (IOR,), passes=True),
        Closure("EMISSION", "EMISSION", (Parameter("aov", 0, 0.0, LARGEST, varies=False),)),
        Closure(
            "SHEEN",
            "MATT",
            (Parameter("width", 0, 0.0, LARGEST), Parameter("lean", 1, 0.0, 1.0)),
            "POINT",
            5,
        ),
        Closure("TRANSLUCENT", "MATT", normal="POINT"),
        Closure("HOLDOUT", "NOTHING", passes=True),
        Closure("TOON_DIFFUSE", "MATT", TOON, "POINT", 5),
        Closure("TOON_SPECULAR", "GLOSSY", TOON, "POINT", 5),
        Closure("OREN_NAYAR", "MATT", (EXPONENT,), "POINT", 3, by_view=True),
        Closure("OREN_NAYAR_MULTIPLE", "MATT", (EXPONENT,), "POINT", 3, by_view=True),
        Closure("FIBRE_DIFFUSE", "MATT", columns=6, of_fibre=True),
        Closure("FIBRE_SPECULAR", "GLOSSY", FIBRE, columns=9, of_fibre=True),
        Closure("FIBRE_TRANSMISSION", "GLOSSY", FIBRE, columns=9, of_fibre=True),
    )
}
"""By name, in the order in which materials are sums of them."""

KINDS = tuple(CLOSURES)
