"""Nodes that read the object of the shaded point, one placement as another or each its own."""

from __future__ import annotations

from ....engine.program.graph import Value
from .reader import READERS, NodeInputs, Outputs

RANDOM = "(random)"
COLOR = "(object colour)"
INDEX = "(object index)"
"""Names of what `properties.value_of` says of every object."""
INSTANCER_GENERATED = "(instancer generated)"
INSTANCER_UV = "(instancer uv)"
"""Where instances are on what carries them; zeros of what is none."""
SPACE_SCALE = "(texture space scale)"
SPACE_START = "(texture space start)"
"""Generated coordinates are the place in the object times the one plus the other."""
OF_EACH = (RANDOM, INSTANCER_GENERATED, INSTANCER_UV)
"""Of these each instance of one thing has its own."""
OBJECT, INSTANCER, VIEW_LAYER = "OBJECT:", "INSTANCER:", "VIEW_LAYER:"
"""Prefixes of names of properties, by who has them: Blender's identifiers of attribute types."""


def _object_info(view: NodeInputs) -> Outputs:

    def value(name: str) -> tuple[Value, ...]:
        return view.apply("instance_value", attribute=name)

    return view.used(
        {
            "Location": lambda: view.apply("object_location")[0],
            "Color": lambda: value(COLOR)[0],
            "Alpha": lambda: value(COLOR)[1],
            "Object Index": lambda: value(INDEX)[1],
            "Material Index": lambda: view.reader.graph.constant(view.reader.material_index),
            "Random": lambda: value(RANDOM)[1],
        }
    )


def property_of_object(view: NodeInputs) -> Outputs:
    """The outputs of an Attribute node that reads no geometry; zeros where nothing has the name,
    as where there is none.
    """
    name = f"{view.node.attribute_type}:{view.node.attribute_name}"
    color, alpha = view.apply("instance_value", attribute=name)
    grey = view.apply("vector_average", color)[0]
    return {"Color": color, "Vector": color, "Alpha": alpha, "Fac": grey, "Factor": grey}


READERS["ShaderNodeObjectInfo"] = _object_info
