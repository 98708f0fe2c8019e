// How far the primitives of a tree reach. The box of a turned object is far too large when it is
// made from the object's box.
#pragma once
#include "bvh/source.h"

namespace glint {

/// A box in world space round the primitives of a tree with at least one, with room for the
/// rounding of rays to float in object space. NaN-free for finite matrices. Not quite the smallest
/// one where many nodes reach equally far.
BoxD world_box(const Tree& tree, const Affine& m);

/// How far primitives are away from the middle of their tree's box: the radius of a ball, to float
/// precision.
double ball_radius(const Tree& tree);

}  // namespace glint
